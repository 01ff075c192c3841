#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

namespace perch {

// H with (u, v, 1) ~ H (x, y, 1) for each pair, least squares by the normalised DLT (Hartley 1997).
// At least four pairs, no three of them in a line; empty when the sizes differ, a number is not finite or
// the points are (nearly) degenerate, so that the H returned can be inverted. Scaled to unit Frobenius norm.
std::optional<Eigen::Matrix3d> homography_from_points(std::span<const Eigen::Vector2d> from,
                                                      std::span<const Eigen::Vector2d> to);

// The image of a point under H; infinite where H sends it to infinity.
inline Eigen::Vector2d apply(const Eigen::Matrix3d& H, const Eigen::Vector2d& p) {
  return (H * p.homogeneous()).hnormalized();
}

}  // namespace perch
