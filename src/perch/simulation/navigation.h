#pragma once

#include <cstdint>
#include <vector>

#include "perch/simulation/descent.h"

namespace perch {

struct NavigationOptions {
  double rate_hz = 50;
  // Together the 2 cm that the paper's differential GPS had.
  double position_white = 0.01;    // one deviation of each axis, m
  double position_drift = 0.0173;  // of the slowly varying part, m
  double attitude_white = 0.003;   // rad
  double attitude_drift = 0.005;
  double velocity_white = 0.03;   // m/s
  double drift_correlation = 20;  // s
  double time_offset = 0;         // camera clock minus navigation clock, s
};

// What an INS/GPS reports of a moment: FORMATS' nav0 row.
struct NavigationReport {
  int64_t timestamp_ns = 0;  // navigation clock
  Rigid3 world_from_body;
  Eigen::Vector3d body_velocity_in_world = Eigen::Vector3d::Zero();
};

// The reports of a whole descent, from a little before to a little after it. `start_ns` is the time of t = 0
// on the camera's clock. Errors are white noise plus an Ornstein-Uhlenbeck process each, attitude errors in
// the axes of the world: reported = Exp(e) true.
std::vector<NavigationReport> navigate(const Descent& descent, const NavigationOptions& options,
                                       int64_t start_ns, uint64_t seed);

}  // namespace perch
