#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/camera/calibration.h"
#include "perch/target/landing_target.h"

namespace perch {

// What a calibration contributes to where a UAV takes itself to be, by its covariance through the pose of a
// landing target: the lens's error d shifts the target's corners by B d, and the pose that fits best takes
// them up,
//
//   pad error = (J'J)^-1 J' B d,   J = d corners / d pose,
//
// and the position told is that of the camera in the pad's frame. The target faces the camera, which hovers
// level above it, and is seen at places all over the picture.
struct LandingError {
  double range = 0;  // m
  // Standard deviations of the position, m: the root mean square over the directions in the picture and the
  // worst of them, in the worst direction of space.
  double mean_m = 0, worst_m = 0;
  Eigen::Vector2d worst_pixel = Eigen::Vector2d::Zero();  // where the target's middle is then
  double mean_rotation = 0;                               // rad
  // The mean for a UAV whose mount was measured with a ruler: a lens that seems to look elsewhere is then an
  // error too, which a mount calibrated with this same lens has taken up.
  double without_mount_calibration_m = 0;
  int directions = 0;  // in which the whole target is in the picture; 0: it never is, and nothing is known
};

LandingError landing_error(const LensFit& fit, const LensCovariance& covariance, const LandingTarget& target,
                           double range);

}  // namespace perch
