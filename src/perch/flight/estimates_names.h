#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "perch/estimator/estimate.h"

namespace perch {

// The names in estimates.csv and states.csv, for the writer and the reader.

inline constexpr std::pair<EstimateStatus, std::string_view> kStatusNames[] = {
    {EstimateStatus::kOk, "ok"},
    {EstimateStatus::kNoTarget, "no_target"},
    {EstimateStatus::kPartial, "partial"},
    {EstimateStatus::kAmbiguous, "ambiguous"},
    {EstimateStatus::kRejected, "rejected"},
    {EstimateStatus::kUnreadable, "unreadable"},
};
inline constexpr std::pair<StateSource, std::string_view> kSourceNames[] = {
    {StateSource::kVision, "vision"}, {StateSource::kPredicted, "predicted"}, {StateSource::kLost, "lost"}};

template <typename Enum, size_t n>
std::string_view name_of(const std::pair<Enum, std::string_view> (&names)[n], Enum value) {
  for (const auto& [candidate, name] : names) {
    if (candidate == value) return name;
  }
  return "";
}

template <typename Enum, size_t n>
std::optional<Enum> value_of(const std::pair<Enum, std::string_view> (&names)[n], std::string_view text) {
  for (const auto& [candidate, name] : names) {
    if (name == text) return candidate;
  }
  return std::nullopt;
}

const std::vector<std::string>& estimate_columns();
const std::vector<std::string>& state_columns();

}  // namespace perch
