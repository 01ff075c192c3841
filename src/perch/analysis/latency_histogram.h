#pragma once

#include <array>
#include <cstdint>

namespace perch {

// How long something took, each time for hours, in memory that does not grow: counts in buckets that are
// 4.4 % wide, 16 to an octave from 1 us to 134 s.
class LatencyHistogram {
 public:
  // What took less than no time (two clocks that do not quite agree) took none.
  void add(int64_t ns);
  void add(const LatencyHistogram& other);
  void clear() { *this = {}; }

  uint64_t count() const { return count_; }
  // The latency that a fraction of all stays below, us, within the width of a bucket; 0 of none.
  double quantile_us(double fraction) const;
  double worst_us() const { return static_cast<double>(worst_ns_) * 1e-3; }

 private:
  static constexpr int kPerOctave = 16, kOctaves = 27;

  std::array<uint64_t, kPerOctave * kOctaves> counts_{};
  uint64_t count_ = 0;
  int64_t worst_ns_ = 0;
};

}  // namespace perch
