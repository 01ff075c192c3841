#include "perch/analysis/latency_histogram.h"

#include <algorithm>
#include <cmath>

namespace perch {

void LatencyHistogram::add(int64_t ns) {
  const double us = std::max(1.0, static_cast<double>(ns) * 1e-3);
  const auto bucket = static_cast<size_t>(kPerOctave * std::log2(us));
  ++counts_[std::min(bucket, counts_.size() - 1)];
  ++count_;
  worst_ns_ = std::max(worst_ns_, ns);
}

void LatencyHistogram::add(const LatencyHistogram& other) {
  for (size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
  count_ += other.count_;
  worst_ns_ = std::max(worst_ns_, other.worst_ns_);
}

double LatencyHistogram::quantile_us(double fraction) const {
  const double wanted = fraction * static_cast<double>(count_);
  double below = 0;
  for (size_t i = 0; i < counts_.size() && count_ > 0; ++i) {
    const auto here = static_cast<double>(counts_[i]);
    if (here > 0 && below + here >= wanted) {
      // The logarithms of a bucket's latencies are taken as spread evenly over it.
      const double part = std::clamp((wanted - below) / here, 0.0, 1.0);
      return std::min(worst_us(), std::exp2((static_cast<double>(i) + part) / kPerOctave));
    }
    below += here;
  }
  return 0;
}

}  // namespace perch
