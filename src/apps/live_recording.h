#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "perch/flight/flight_recorder.h"

namespace perch {

// The recording of a run, which may be stopped and started while it goes on; each start is a new flight.
// Whoever records takes a copy of the pointer, so that the last to finish with a recorder closes it.
class LiveRecording {
 public:
  using Make = std::function<std::unique_ptr<FlightRecorder>()>;

  // `make` may be empty: there is nowhere to record to. Begins when it is not. Throws what `make` throws.
  explicit LiveRecording(Make make) : make_(std::move(make)) {
    if (make_) recorder_ = make_();
  }

  std::shared_ptr<FlightRecorder> recorder() const {
    const std::lock_guard lock(mutex_);
    return recorder_;
  }

  // What came of it, for the log. They wait for the disk: not for the estimator's thread.
  std::string start();
  std::string stop();
  nlohmann::json status() const;

 private:
  const Make make_;
  mutable std::mutex mutex_;
  std::shared_ptr<FlightRecorder> recorder_;
};

}  // namespace perch
