#pragma once

#include <Eigen/Core>
#include <cmath>

#include "perch/import/log_tables.h"

namespace perch {

// A table's numbers by row and name; NaN where it has no such column. No table has no rows.
class LogRows {
 public:
  explicit LogRows(const LogTable* table) : table_(table) {}

  size_t size() const { return table_ ? table_->rows() : 0; }
  bool has(std::string_view name) const { return table_ && table_->column(name); }
  double at(size_t row, std::string_view name) const {
    const auto column = table_->column(name);
    return column ? table_->at(row, *column) : std::nan("");
  }
  Eigen::Vector3d at(size_t row, std::string_view x, std::string_view y, std::string_view z) const {
    return {at(row, x), at(row, y), at(row, z)};
  }

 private:
  const LogTable* table_;
};

// -1 for what is no time: one of more than a century is a flipped bit, and sums of two are to fit 64 bits.
inline int64_t ns_of_us(double us) { return us >= 0 && us < 4e15 ? static_cast<int64_t>(us) * 1000 : -1; }

}  // namespace perch
