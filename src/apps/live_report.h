#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "live_latency.h"
#include "perch/camera/live_source.h"
#include "perch/estimator/estimate.h"

namespace perch {

// What became of the frames. Any thread may ask.
class FrameCounts {
 public:
  void add(EstimateStatus status) {
    const std::lock_guard lock(mutex_);
    ++counts_[static_cast<size_t>(status)];
  }
  uint64_t all() const;
  uint64_t of(EstimateStatus status) const;
  nlohmann::ordered_json json() const;

 private:
  mutable std::mutex mutex_;
  std::array<uint64_t, 6> counts_{};
};

// "camera 21.3/25.1/30.2 ms", median, 99 % and worst of each stage that was gone through; empty without any.
std::string latency_text(const LiveHistograms& histograms);
nlohmann::ordered_json latency_json(const LiveHistograms& histograms);
nlohmann::ordered_json camera_json(const LiveCounters& counters);

}  // namespace perch
