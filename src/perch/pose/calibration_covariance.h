#pragma once

#include <span>

#include "perch/camera/camera_model.h"
#include "perch/geometry/uncertainty.h"
#include "perch/pose/reprojection.h"

namespace perch {

// What the camera model's own uncertainty adds to a pose's covariance. Intrinsics that are off by e shift the
// features' projections by B e, and the pose that fits best moves by S e with them:
//
//   S = -(J'J)^-1 J'B,   J = d pixels / d pose,   B = d pixels / d intrinsics;   the term is S Cov(e) S'.
//
// Unlike noise it does not average out over frames: it is the same error in all pictures of a flight, common
// to them as far as the target is at the same place. All features weigh alike. Zero when the model's
// covariance is not known or a feature cannot be projected. 10 us for 24 features.
PoseCovariance calibration_covariance(const CameraModel& camera, std::span<const Observation> features,
                                      const Rigid3& camera_from_target);

}  // namespace perch
