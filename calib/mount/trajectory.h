#pragma once

#include <cstdint>
#include <optional>

#include "calib/mount/smoothing_spline.h"
#include "perch/flight/nav_track.h"
#include "perch/geometry/uncertainty.h"

namespace perch {

// Where navigation has the vehicle at any moment, with its rates: the time offset is found from them.
struct TrajectoryPoint {
  Rigid3 world_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   // of the body in the world, m/s
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  // R(t + dt) = Exp(turn_rate dt) R(t), rad/s
  PoseError noise_part = PoseError::Ones();             // variance of (d, r) over that of a single sample's
};

// Navigation's samples as a smooth curve: smoothing splines of position and of the quaternion. Joining the
// samples by straight lines makes white noise of 2 cm at 100 Hz a velocity of 2.8 m/s, in which the time
// offset drowns. The rates are the curve's own derivatives: with those of local quadratics, which estimate
// the motion's and not the curve's, the least squares had a gradient that its cost did not have, and stood
// still off its minimum.
//
// Never across a gap of more than NavTrack::kMaxGap; empty there and beyond the ends.
class Trajectory {
 public:
  explicit Trajectory(NavTrack nav);

  std::optional<TrajectoryPoint> at(int64_t navigation_ns) const;

  const NavTrack& nav() const { return nav_; }
  double step() const { return position_.step(); }  // the usual one between samples, s
  // Deviation of a sample from the curve on each axis, m and rad; 0 where too few samples tell.
  double position_noise() const { return position_.noise(); }
  double rotation_noise() const { return 2 * rotation_.noise(); }  // a quaternion turns by half the angle

 private:
  NavTrack nav_;
  SmoothingSpline position_, rotation_;
};

}  // namespace perch
