#pragma once

#include <cstdint>

namespace perch {

// The time of live sources: CLOCK_MONOTONIC in ns, or a test's own.
class LiveClock {
 public:
  virtual ~LiveClock() = default;
  virtual int64_t now_ns() = 0;
  virtual void sleep_until(int64_t time_ns) = 0;
};

LiveClock& monotonic_clock();

}  // namespace perch
