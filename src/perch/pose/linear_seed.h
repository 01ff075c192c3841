#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "perch/geometry/rigid3.h"

namespace perch {

// How a plane is seen: x ~ H (q - centre, 1), with the centroid of the points for the centre. That, unlike
// the target's origin, is surely in front of the camera: a board of tags may lie to one side of its origin.
struct PlaneView {
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
};

// The paper's section 2.2.2: camera_from_target from points of the target's plane q = (q1, q2, 0) and their
// image points x = (x1, x2, 1) of an ideal camera (pixels undistorted and divided by depth).
//
// The null vector of F (equations 2.5 and 2.6) is [r1 r2 p], the homography from the plane to the image. It
// is sought by block elimination of F'F (a 3x3 eigenproblem: a twentieth of the time of the SVD of F, and as
// good once the points are conditioned as Hartley does), the scale is that of r1 and r2, the sign that of a
// target in front of the camera, and R the rotation nearest to [r1 r2].
//
// At least four points, no three in a line. Empty when they are fewer, (nearly) in a line, not finite, or
// seen from behind.
std::optional<Rigid3> linear_seed(std::span<const Eigen::Vector2d> plane,
                                  std::span<const Eigen::Vector2d> image);

// Its two halves: the null vector of F,
std::optional<PlaneView> plane_view(std::span<const Eigen::Vector2d> plane,
                                    std::span<const Eigen::Vector2d> image);
// and R and p from it.
std::optional<Rigid3> linear_seed(const PlaneView& view);

// R and p from H ~ [r1 r2 p], the second half of the same section.
std::optional<Rigid3> pose_from_homography(const Eigen::Matrix3d& H);

}  // namespace perch
