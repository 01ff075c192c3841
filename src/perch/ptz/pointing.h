#pragma once

#include <Eigen/Core>
#include <optional>

#include "perch/camera/camera_model.h"
#include "perch/frames/frame_chain.h"

namespace perch {

// The pan and tilt that bring what is seen along one ray of the camera to where another ray looks: eqs. 3.1
// to 3.3 of the paper, theta = h(p1) - h(p0), through the real lens, and exact off the axes of the picture,
// where a pan also moves a point up or down. `direction_in_zero` is what the target's ray is at zero angles.
//
//   Ry(pan) Rx(tilt) ray0 = direction,   ray = K^-1 (pixel)
//
// Empty when no angles do that: the direction is too near the pan axis.
std::optional<HeadAngles> angles_to_see_at(const Eigen::Vector3d& direction_in_zero,
                                           const Eigen::Vector3d& desired_ray);

// What a ray of the camera is at zero angles.
Eigen::Vector3d zero_from_camera(const HeadAngles& angles, const Eigen::Vector3d& ray);

// The relative motion that brings what is seen at `from_px` to `to_px`. Empty where the lens does not see.
std::optional<HeadAngles> angles_between(const CameraModel& camera, const HeadAngles& now,
                                         const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px);

}  // namespace perch
