#pragma once

#include <cstdint>

#include "perch/geometry/rigid3.h"
#include "perch/simulation/gust.h"

namespace perch {

// What a vehicle does at a moment. World NED, body FRD, as MAVLink has them.
struct VehicleTruth {
  Rigid3 world_from_body;
  Eigen::Vector3d body_velocity_in_world = Eigen::Vector3d::Zero();      // m/s
  Eigen::Vector3d body_acceleration_in_world = Eigen::Vector3d::Zero();  // m/s^2
};

struct DescentOptions {
  double start_height = 8;     // of the body over the pad, m
  double start_aside = 2;      // horizontally from the pad, m
  double start_bearing = 0.6;  // of the start seen from the pad, rad from north to east; the nose points back
  double touchdown_height = 1;  // where the descent ends, m
  double touchdown_aside =
      0.2;               // still short of the pad: a camera that looks forward then has it in its middle, m
  double duration = 12;  // of the descent, s
  double hover = 1;      // held there afterwards, s
  double yaw_drift = 0.02;        // rad/s
  double gust_position = 0.06;    // one deviation of each axis, m
  double gust_attitude = 0.015;   // rad
  double gust_correlation = 1.5;  // s
};

// A landing: from beside and above straight to the pad, slower and slower, then held there, pushed about by
// gusts. Position is a quintic in time (from -1.3 times its mean speed to rest) plus a gust; the attitude is
// what a multirotor needs for that acceleration, its thrust along -z of the body,
//
//   z_body = (g - a) / |g - a|,
//
// the heading that of the options, plus a gust of its own. The same seed flies the same way.
class Descent {
 public:
  Descent(const DescentOptions& options, const Eigen::Vector3d& pad_in_world, uint64_t seed);

  // At t in s; the descent begins at 0. Any t is allowed: before 0 the quintic is left along its tangent.
  VehicleTruth at(double t) const;
  double duration() const { return options_.duration + options_.hover; }

 private:
  DescentOptions options_;
  Eigen::Vector3d start_, end_;
  RandomStream random_;
  Gust position_gust_, attitude_gust_;
};

}  // namespace perch
