#pragma once

#include <cstdint>
#include <optional>

#include "perch/flight/nav_track.h"
#include "perch/geometry/uncertainty.h"

namespace perch {

// Where navigation has the vehicle at any moment, with its rates: the time offset is found from them.
struct TrajectoryPoint {
  Rigid3 world_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   // of the body in the world, m/s
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  // R(t + dt) = Exp(turn_rate dt) R(t), rad/s
  double noise_part = 1;                                // variance of this point over that of a single sample
};

// Navigation's samples as a curve. Joining them by straight lines makes white noise of 2 cm at 100 Hz a
// velocity of 2.8 m/s, in which the time offset drowns; so position and rotation are quadratics, fitted to
// the samples within `half_window` of the moment by weighted least squares (local regression with the weights
// 1 - u^2, which let samples come and go smoothly). half_window 0 joins the samples: for navigation that is
// exact at its samples and jumps between them.
//
// Never across a gap of more than NavTrack::kMaxGap; empty there and beyond the ends.
class Trajectory {
 public:
  Trajectory(NavTrack nav, double half_window);

  std::optional<TrajectoryPoint> at(int64_t navigation_ns) const;

  const NavTrack& nav() const { return nav_; }
  double half_window() const { return half_window_; }
  bool smooth() const { return half_window_ > 0; }
  // Deviation of the samples from the curve on each axis, m and rad, freed from what the curve follows; 0
  // where samples are joined.
  double position_noise() const { return position_noise_; }
  double rotation_noise() const { return rotation_noise_; }

 private:
  struct Fit {
    TrajectoryPoint point;
    double leverage = 0;  // weight of a sample at the moment itself
  };
  std::optional<Fit> fit(int64_t ns) const;
  std::optional<TrajectoryPoint> join(int64_t ns) const;
  void measure_noise();

  NavTrack nav_;
  double half_window_;
  double position_noise_ = 0, rotation_noise_ = 0;
};

// The window for samples this far apart: a tenth of a second to either side, or two and a half samples.
double usual_half_window(const NavTrack& nav);

}  // namespace perch
