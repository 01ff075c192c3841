#include "perch/geometry/so3.h"

#include <Eigen/SVD>
#include <cmath>

namespace perch {

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  // sin(a/2)/a: the series' next term, a^4/3840, is below rounding for a < 1e-3.
  const double k = angle < 1e-3 ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
  const Eigen::Vector3d v = k * rotation_vector;
  return Eigen::Quaterniond(std::cos(angle / 2), v.x(), v.y(), v.z()).normalized();
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0 ? -1 : 1;
  const double w = sign * rotation.w();
  const double n = rotation.vec().norm();
  // atan2 and not acos: acos loses half the digits near the identity.
  const double k = n < 1e-12 ? 2.0 / w : 2 * std::atan2(n, w) / n;
  return sign * k * rotation.vec();
}

Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& rotation_vector) {
  const double a2 = rotation_vector.squaredNorm();
  const double a = std::sqrt(a2);
  // Below 1e-4 the differences 1 - cos a and a - sin a lose more digits than the series' next terms.
  const bool small = a < 1e-4;
  const double b = small ? 0.5 - a2 / 24 : (1 - std::cos(a)) / a2;
  const double c = small ? 1.0 / 6 - a2 / 120 : (a - std::sin(a)) / (a2 * a);
  const Eigen::Matrix3d r = skew(rotation_vector);
  return Eigen::Matrix3d::Identity() + b * r + c * r * r;
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  // The sign goes to the smallest singular value: that changes the result least.
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  return u * svd.matrixV().transpose();
}

}  // namespace perch
