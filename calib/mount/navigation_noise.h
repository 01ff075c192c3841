#pragma once

#include <vector>

#include "calib/mount/mount_types.h"
#include "calib/mount/sight_chain.h"

namespace perch {

// Navigation minus vision over a flight, in the world.
struct NoiseSamples {
  std::vector<size_t> pictures;  // the flight's sightings
  std::vector<double> times;     // s
  std::vector<PoseError> errors;
  std::vector<Vector6d> camera_variance;  // what vision's own covariance makes of them
  std::vector<Vector6d> noise_part;       // TrajectoryPoint's
};

// Before anything is fitted: generous.
NavigationNoise first_noise(const NavigationNoise& given, const Trajectory& trajectory, double start_misfit);

// What is not given is measured. White noise: of the samples about the smooth trajectory, else what errors
// have no memory of. Drift: what errors 0.3 to 1 s apart have in common, when that is more than chance, with
// the time in which it falls to 1/e. Navigation filters hardly have white noise, and drift of a GPS taken for
// white noise makes the stated deviations many times too small.
NavigationNoise measured_noise(const NavigationNoise& given, const Trajectory& trajectory,
                               const NoiseSamples& samples);

}  // namespace perch
