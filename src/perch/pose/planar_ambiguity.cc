#include "perch/pose/planar_ambiguity.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace perch {

Rigid3 mirrored_pose(const Rigid3& camera_from_target) {
  const Eigen::Vector3d v = camera_from_target.translation.normalized();
  const Eigen::Matrix3d R = camera_from_target.rotation.toRotationMatrix();
  const Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity() - 2 * v * v.transpose();
  // The mirror's determinant and that of the turned third axis are both -1.
  const Eigen::Matrix3d mirrored = mirror * R * Eigen::Vector3d(1, 1, -1).asDiagonal();
  return {Eigen::Quaterniond(mirrored).normalized(), camera_from_target.translation};
}

std::optional<std::array<Rigid3, 2>> infinitesimal_poses(const PlaneView& view) {
  // The centre's image x0, and J = dx / dq there.
  const Eigen::Matrix3d H = view.H / view.H(2, 2);
  const Eigen::Vector2d x0 = H.topRightCorner<2, 1>();
  const Eigen::Matrix2d J = H.topLeftCorner<2, 2>() - x0 * H.bottomLeftCorner<1, 2>();
  // With R = Q R', Q turning the z axis towards x0, and p = z (x0, 1), J = B R'_22 / z: B is [I -x0] Q, whose
  // third column is zero, R'_22 the upper left of R', the larger singular value of which is 1.
  const Eigen::Matrix3d Q =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), x0.homogeneous()).toRotationMatrix();
  const Eigen::Matrix2d B = Q.topLeftCorner<2, 2>() - x0 * Q.bottomLeftCorner<1, 2>();
  const Eigen::Matrix2d A = B.inverse() * J;
  const double squares = A.squaredNorm(), det = A.determinant();
  const double largest =
      std::sqrt((squares + std::sqrt(std::max(0.0, squares * squares - 4 * det * det))) / 2);
  // The third element of the normal, det A / largest^2, towards the camera.
  if (!(det < -1e-9 * squares) || !std::isfinite(largest)) return std::nullopt;
  const Eigen::Matrix2d R22 = A / largest;
  // The third row c of the first two columns, up to its sign: c c' = I - R22' R22.
  const Eigen::Matrix2d cc = Eigen::Matrix2d::Identity() - R22.transpose() * R22;
  const Eigen::Index k = cc(0, 0) > cc(1, 1) ? 0 : 1;
  const Eigen::Vector2d c =
      cc(k, k) > 0 ? Eigen::Vector2d(cc.col(k) / std::sqrt(cc(k, k))) : Eigen::Vector2d::Zero();

  std::array<Rigid3, 2> poses;
  for (const double sign : {1.0, -1.0}) {
    Eigen::Matrix3d R;
    R.topLeftCorner<2, 2>() = R22;
    R.bottomLeftCorner<1, 2>() = sign * c.transpose();
    R.col(2) = R.col(0).cross(R.col(1));
    Rigid3& pose = poses[sign > 0 ? 0 : 1];
    pose.rotation = Eigen::Quaterniond(Eigen::Matrix3d(Q * R)).normalized();
    const Eigen::Vector3d centre(view.centre.x(), view.centre.y(), 0);
    pose.translation = x0.homogeneous() / largest - pose.rotation * centre;
  }
  return poses;
}

}  // namespace perch
