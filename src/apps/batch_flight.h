#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "perch/analysis/report.h"
#include "perch/estimator/run_config.h"

namespace perch {

// What a batch does with one flight: read it, estimate every frame, write OUT/FLIGHTNAME, score it, and draw
// the frames its report shows.
struct BatchFlight {
  const RunConfig& config;
  std::filesystem::path folder;      // FLIGHT
  std::filesystem::path output;      // OUT/FLIGHTNAME
  const std::atomic<bool>& stop;     // set: leave as soon as possible
  std::function<void()> frame_done;  // called from any thread
};

// Thrown when `stop` was set; nothing of the flight was written then.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted") {}
};

// Throws std::runtime_error naming what made the flight as a whole impossible, or Interrupted. Frames and
// rows that are wrong are counted in the score's problems.
ReportFlight run_flight(const BatchFlight& job);

}  // namespace perch
