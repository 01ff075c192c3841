#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace perch {

// Which rows to keep so that their times increase strictly and the fewest rows are lost: the longest
// increasing subsequence, the earlier of two equal times. Taking each row that is later than the one before
// it would lose a whole flight to one row with a time too late.
std::vector<bool> keep_increasing(std::span<const int64_t> times_ns);

// The kept of `rows`, each with its `timestamp_ns`; what is left out is noted with its line in `places`.
template <typename Row>
std::vector<Row> in_time_order(std::vector<Row> rows, const std::vector<std::string>& places,
                               std::vector<std::string>& problems) {
  std::vector<int64_t> times;
  times.reserve(rows.size());
  for (const Row& row : rows) times.push_back(row.timestamp_ns);
  const std::vector<bool> keep = keep_increasing(times);
  std::vector<Row> kept;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (keep[i]) {
      kept.push_back(std::move(rows[i]));
    } else {
      problems.push_back(places[i] + ": the clock goes back or stands still at " + std::to_string(times[i]) +
                         ", row skipped");
    }
  }
  return kept;
}

}  // namespace perch
