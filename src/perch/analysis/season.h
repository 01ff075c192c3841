#pragma once

#include <nlohmann/json.hpp>

namespace perch {

// All flights of a run at once, for the page: one list a column, so that thousands of flights are small, in
// the order in which they were added.
class Season {
 public:
  Season();
  // A flight's summary_json, or its summary.json.
  void add(const nlohmann::ordered_json& summary);
  const nlohmann::ordered_json& json() const { return columns_; }

 private:
  nlohmann::ordered_json columns_;
};

}  // namespace perch
