#pragma once

#include <filesystem>
#include <string>

#include "perch/simulation/simulation.h"

namespace perch {

// Writes a simulated flight as a recorded one (docs/FORMATS.md), beside the name it is to have:
//
//   FLIGHT.part/            while it is written; becomes FLIGHT in one step by finish(), goes by the
//   destructor
//     simulation.yaml       the configuration as resolved, and the mark by which a folder is known as ours
//     perch.yaml            a configuration for perch-batch with the true frames; target.yaml beside it
//     mav0/cam0, nav0, state_groundtruth_estimate0    and cam0/truth_target_pose.csv
//     mav0/truth_pad_from_body.csv, and pad0 when the pad is on a deck
class FlightFolder {
 public:
  // Throws std::runtime_error when `folder` holds anything and is not a simulated flight with `force` given.
  FlightFolder(const std::filesystem::path& folder, bool force);
  ~FlightFolder();
  FlightFolder(const FlightFolder&) = delete;
  FlightFolder& operator=(const FlightFolder&) = delete;

  // Each throws std::runtime_error when it cannot write. Frames may be written by several threads at once.
  void write_frame(const SimulatedFlight& flight, int64_t frame) const;
  void write_tables(const SimulatedFlight& flight, const std::string& resolved_configuration) const;
  void finish();

 private:
  void write_motions(const SimulatedFlight& flight) const;

  std::filesystem::path folder_, part_;
};

}  // namespace perch
