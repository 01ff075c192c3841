#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace perch {

// Rotation vectors (axis times angle, rad) and unit quaternions: the exponential map of SO(3) and its
// inverse.

// The matrix of the cross product: skew(a) * b = a x b.
inline Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

// Exp: exact to rounding for every vector, the null vector included.
Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_vector);

// Log: |result| <= pi. At pi either of the two axes may come out.
Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation);

// J with Exp(r + d) = Exp(J(r) d) Exp(r) to first order in d.
Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& rotation_vector);

// The rotation nearest to m in the Frobenius norm, by SVD, determinant +1. m must be finite.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m);

}  // namespace perch
