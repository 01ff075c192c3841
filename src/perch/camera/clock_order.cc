#include "perch/camera/clock_order.h"

#include <algorithm>

namespace perch {

// Patience sorting: ends[n] is the row that ends the best sequence of n + 1 rows so far.
std::vector<bool> keep_increasing(std::span<const int64_t> times_ns) {
  constexpr size_t kNone = static_cast<size_t>(-1);
  std::vector<size_t> ends, before(times_ns.size(), kNone);
  for (size_t i = 0; i < times_ns.size(); ++i) {
    const auto place = std::lower_bound(ends.begin(), ends.end(), times_ns[i],
                                        [&](size_t row, int64_t time) { return times_ns[row] < time; });
    if (place != ends.begin()) before[i] = *std::prev(place);
    if (place == ends.end()) {
      ends.push_back(i);
    } else if (times_ns[*place] != times_ns[i]) {
      *place = i;
    }
  }
  std::vector<bool> keep(times_ns.size(), false);
  for (size_t i = ends.empty() ? kNone : ends.back(); i != kNone; i = before[i]) keep[i] = true;
  return keep;
}

}  // namespace perch
