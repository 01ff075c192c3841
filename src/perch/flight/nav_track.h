#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "perch/geometry/rigid3.h"

namespace perch {

struct NavSample {
  int64_t timestamp_ns = 0;  // navigation clock
  Rigid3 world_from_body;  // its rotation NaN where the source tells no attitude: a receiver with one antenna
  Eigen::Vector3d body_velocity_in_world = Eigen::Vector3d::Zero();  // m/s

  bool knows_attitude() const { return world_from_body.rotation.coeffs().allFinite(); }
};

// The navigation source's poses, times strictly increasing.
struct NavTrack {
  std::vector<NavSample> samples;

  static constexpr double kMaxExtrapolation = 0.05;  // s; FORMATS: never more than 50 ms

  // The pose at a moment of the navigation clock: between two samples by interpolation (none when they are
  // more than kMaxGap apart), beyond the ends by the last velocity for at most `ahead` seconds. Empty
  // otherwise.
  std::optional<NavSample> at(int64_t timestamp_ns, double ahead = kMaxExtrapolation) const;

  // Linear interpolation of a vehicle that accelerates with 2 m/s^2 over a gap T is off by 2 T^2 / 8: 6 cm at
  // 0.5 s.
  static constexpr double kMaxGap = 0.5;  // s
};

}  // namespace perch
