#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>

#include "perch/estimator/run_config.h"

namespace perch {

// What a batch does with one flight: read it, estimate every frame, score it, draw the frames its report
// shows, and write all of it into a folder.
struct BatchFlight {
  const RunConfig& config;
  const std::string& resolved;       // the configuration, for the report
  bool times;                        // measured times go into the results
  std::filesystem::path folder;      // FLIGHT
  std::filesystem::path output;      // an empty folder that is not the result yet
  const std::atomic<bool>& stop;     // set: leave as soon as possible
  std::function<void(double)> done;  // a further part of the flight is; called from any thread
};

// Thrown when `stop` was set; what was written then is not whole.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted") {}
};

// Returns the errors for a terminal. Throws std::runtime_error naming what made the flight as a whole
// impossible, or Interrupted. Frames and rows that are wrong are counted in the score's problems.
std::string run_flight(const BatchFlight& job);

}  // namespace perch
