#pragma once

#include <mutex>
#include <string>

#include "perch/camera/live_source.h"

namespace perch {

// The counters of a live source; any thread may ask for them.
class LiveTally {
 public:
  LiveCounters counters() const {
    const std::lock_guard lock(mutex_);
    return counters_;
  }
  // A picture that is given out, its size compared with the last one's.
  void picture(const Frame& frame) {
    const std::lock_guard lock(mutex_);
    ++counters_.frames;
    if (!frame.problem.empty()) counters_.last_problem = frame.problem;
    if (frame.grey.empty()) return;
    if (!size_.empty() && frame.grey.size() != size_) ++counters_.resized;
    size_ = frame.grey.size();
  }
  void add(int64_t LiveCounters::*counter, int64_t count = 1) {
    const std::lock_guard lock(mutex_);
    counters_.*counter += count;
  }
  void problem(const std::string& what) {
    const std::lock_guard lock(mutex_);
    counters_.last_problem = what;
  }

 private:
  mutable std::mutex mutex_;
  LiveCounters counters_;
  cv::Size size_;  // of the last picture that could be read
};

}  // namespace perch
