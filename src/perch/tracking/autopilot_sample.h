#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

namespace perch {

// What the autopilot says of one moment, as far as it says it. The sigmas are of each axis, and of what is
// new in each sample: errors that stay for seconds (a heading that is off, a velocity that drifts) are found
// out by the filter and need not be in them.
struct AutopilotSample {
  int64_t timestamp_ns = 0;                                 // camera clock
  std::optional<Eigen::Quaterniond> world_from_body;        // attitude
  std::optional<Eigen::Vector3d> body_velocity_in_world;    // m/s
  std::optional<Eigen::Vector3d> angular_velocity_in_body;  // of the body in the world, its own axes, rad/s
  double attitude_sigma = 0.005;                            // rad
  double velocity_sigma = 0.05;                             // m/s
  double angular_velocity_sigma = 0.02;                     // rad/s
};

}  // namespace perch
