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

  // `make` may be empty: there is nowhere to record to. Begins when it is not. A disk that takes nothing,
  // after a restart in the air perhaps, is no reason not to land: then there is no recording, and problem()
  // says why.
  explicit LiveRecording(Make make);

  std::shared_ptr<FlightRecorder> recorder() const {
    const std::lock_guard lock(mutex_);
    return recorder_;
  }

  // What came of it, for the log. They wait for the disk: not for the estimator's thread.
  std::string start();
  std::string stop();
  nlohmann::json status() const;
  // Why the last start came to nothing; empty: it did not.
  std::string problem() const;

 private:
  const Make make_;
  mutable std::mutex mutex_;  // of what follows
  std::shared_ptr<FlightRecorder> recorder_;
  std::string problem_;
};

}  // namespace perch
