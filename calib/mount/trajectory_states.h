#pragma once

#include <ceres/problem.h>

#include <span>

#include "calib/mount/sight_cost.h"

namespace perch {

// The corrections of a flight's trajectory as states of the least squares, one at each picture:
//
//   truth = perturb(navigation, c),   c = u - b
//
// u is what navigation's white noise leaves of the curve, independent from picture to picture; b its drift,
// an Ornstein-Uhlenbeck process through the pictures, absent where there is none.
//
// The curve's errors at neighbouring pictures are the same samples' noise. u of many pictures must not know
// more together than these samples do, so its variance is that of a sample times the number of pictures a
// sample, or the curve's own where that is more. Sharing linear states between pictures, 0.1 s apart, was
// tried: the curve's error is not linear over that time, and half a pixel of misfit moved the lever arm by
// metres.
class TrajectoryStates {
 public:
  // `camera_ns`: of the pictures that are used, ascending.
  TrajectoryStates(const Trajectory& trajectory, const NavigationNoise& noise,
                   std::span<const int64_t> camera_ns, double offset);

  void add_priors(ceres::Problem& problem);
  std::vector<CorrectionPart> parts(size_t picture);

 private:
  struct State {
    double time = 0;                         // s after the first picture
    Vector6d noise_part = Vector6d::Ones();  // of u's variance in that of a sample
    Vector6d u = Vector6d::Zero(), b = Vector6d::Zero();
  };
  NavigationNoise noise_;
  bool drifts_;
  std::vector<State> states_;
};

}  // namespace perch
