#include "perch/geometry/so3.h"

#include <Eigen/SVD>
#include <cmath>

namespace perch {

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  // sin(a/2)/a has no cancellation: only 0/0, where the squares underflow too, needs its limit.
  const double k = angle > 0 ? std::sin(angle / 2) / angle : 0.5;
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
  // (1 - cos a) / a^2 by the half angle: the difference would leave 1e-12 of error in J at a = 1e-4.
  const double half = a > 0 ? std::sin(a / 2) / a : 0.5;
  const double b = 2 * half * half;
  // What a - sin a loses, epsilon / a^2 of c, its factor a^2 takes back; the series serves against 0/0 only.
  const double c = a < 1e-4 ? 1.0 / 6 - a2 / 120 : (a - std::sin(a)) / (a2 * a);
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
