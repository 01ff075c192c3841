#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

#include "perch/camera/live_source.h"

namespace perch {

// The place between the camera's thread and the estimator's. It holds one picture: a newer one takes its
// place, so that what is estimated is never old; or, of a recording of which none may be left out, waits
// until it is taken. Three buffers go round, so that a steady run allocates nothing.
class NewestFrame {
 public:
  enum class WhenFull { kReplace, kWait };
  explicit NewestFrame(WhenFull when_full) : when_full_(when_full) {}

  // Copies the picture, as sources use theirs again. False: closed.
  bool put(const LiveFrame& picture);
  // Waits at most so long. False: none came, or closed and nothing left.
  bool take(LiveFrame& picture, std::chrono::nanoseconds wait);
  // Nothing comes any more; what is there can still be taken.
  void close();

  bool drained() const;
  uint64_t replaced() const;

 private:
  const WhenFull when_full_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  LiveFrame coming_;  // of the thread that puts
  LiveFrame held_;
  bool full_ = false, closed_ = false;
  uint64_t replaced_ = 0;
};

}  // namespace perch
