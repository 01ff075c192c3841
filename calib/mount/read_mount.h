#pragma once

#include <filesystem>
#include <functional>

#include "calib/mount/mount_types.h"
#include "perch/estimator/run_config.h"

namespace perch {

// The configuration's `calibrate_mount` section:
//   prior:                       # what is known from elsewhere, with deviations
//     body_from_base:
//       mean: {position: [x, y, z], rotation: {...}}
//       position_sigma: [x, y, z]       # m
//       rotation_sigma_deg: [x, y, z]
//     world_from_pad: {...}
//     time_offset: {value: 0.0, sigma: 0.005}
//   navigation: {position_sigma, rotation_sigma_deg, position_drift, rotation_drift_deg, drift_time}
//                                # without: measured from the flights
//   offset_reach: 0.25           # s, searched to either side of frames.time_offset
//   limits: {rotation_deg: 0.5, lever_arm: 0.05, time_offset: 0.01, pad: 0.25}   # known worse: not written
// A sigma of 0 in a list says nothing about that axis.
MountOptions read_mount_options(Section section);

struct ReadFlight {
  MountFlight flight;
  std::optional<Rigid3> body_from_camera;  // T_BS
  size_t pictures = 0;
  std::vector<std::string> problems;
};

// Finds the target in every picture. The vehicle's attitude is not used to choose between the two poses of a
// plane: that is by the mount, which is sought. `go_on` is told how many are done, and may say no.
ReadFlight read_mount_flight(const RunConfig& config, const std::filesystem::path& folder,
                             const std::function<bool(size_t)>& go_on);

}  // namespace perch
