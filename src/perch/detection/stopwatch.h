#pragma once

#include <chrono>
#include <string_view>
#include <vector>

#include "perch/detection/detector.h"

namespace perch {

// Times the steps of one frame. It measures and decides nothing: no result depends on it.
class Stopwatch {
 public:
  explicit Stopwatch(std::vector<StageTime>& stages) : stages_(stages) {}

  // Ends the step that began with the last lap, or with the construction.
  void lap(std::string_view stage) {
    stages_.push_back({stage, since_lap_us()});
    last_ = Clock::now();
  }

  double since_lap_us() const {
    return std::chrono::duration<double, std::micro>(Clock::now() - last_).count();
  }
  void restart() { last_ = Clock::now(); }

 private:
  using Clock = std::chrono::steady_clock;
  std::vector<StageTime>& stages_;
  Clock::time_point last_ = Clock::now();
};

}  // namespace perch
