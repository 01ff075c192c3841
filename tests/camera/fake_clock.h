#pragma once

#include <algorithm>

#include "perch/camera/live_clock.h"

namespace perch {

// Time that passes only when somebody sleeps, or the test says so.
class FakeClock : public LiveClock {
 public:
  int64_t now_ns() override { return now_; }
  void sleep_until(int64_t time_ns) override { now_ = std::max(now_, time_ns); }
  void pass(int64_t ns) { now_ += ns; }

 private:
  int64_t now_ = 5'000'000'000;
};

}  // namespace perch
