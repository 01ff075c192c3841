#include "perch/camera/live_clock.h"

#include <time.h>

#include <cerrno>

#include "perch/camera/live_source.h"

namespace perch {

namespace {

class MonotonicClock : public LiveClock {
 public:
  int64_t now_ns() override {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
  }
  void sleep_until(int64_t time_ns) override {
    const timespec until{time_ns / 1'000'000'000, time_ns % 1'000'000'000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
    }
  }
};

}  // namespace

LiveClock& monotonic_clock() {
  static MonotonicClock clock;
  return clock;
}

int64_t camera_now_ns() { return monotonic_clock().now_ns(); }

}  // namespace perch
