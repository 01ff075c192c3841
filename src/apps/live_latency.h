#pragma once

#include <array>
#include <cstdint>
#include <mutex>

#include "perch/analysis/latency_histogram.h"

namespace perch {

// The way of a picture in time.
enum class LiveStage {
  kCamera,    // exposure to the picture in this process; of cameras alone, a recording has another clock
  kWaiting,   // for the estimator
  kEstimate,  // the estimator's own time
  kOutput,    // estimate to MAVLink bytes handed to the kernel
  kTotal,     // exposure (of a recording: arrival) to MAVLink bytes out; without an autopilot to the estimate
};
inline constexpr size_t kLiveStages = 5;
inline constexpr const char* kLiveStageNames[kLiveStages] = {"camera", "waiting", "estimate", "output",
                                                             "total"};

using LiveHistograms = std::array<LatencyHistogram, kLiveStages>;

// Any thread may add.
class LiveLatency {
 public:
  void add(LiveStage stage, int64_t ns) {
    const std::lock_guard lock(mutex_);
    recent_[static_cast<size_t>(stage)].add(ns);
  }
  // Since the last call.
  LiveHistograms take_recent() {
    const std::lock_guard lock(mutex_);
    const LiveHistograms recent = recent_;
    for (size_t i = 0; i < kLiveStages; ++i) {
      before_[i].add(recent_[i]);
      recent_[i].clear();
    }
    return recent;
  }
  // Since the beginning.
  LiveHistograms all() const {
    const std::lock_guard lock(mutex_);
    LiveHistograms all = before_;
    for (size_t i = 0; i < kLiveStages; ++i) all[i].add(recent_[i]);
    return all;
  }

 private:
  mutable std::mutex mutex_;
  LiveHistograms before_, recent_;
};

}  // namespace perch
