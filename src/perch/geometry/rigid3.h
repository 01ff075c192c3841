#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace perch {

// Maps the coordinates of a point from frame a to frame b: p_b = b_from_a * p_a.
// The paper's g_ba (figure 3.2) is our a_from_b of its letters; see docs/FORMATS.md for the names.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // Hamilton, unit
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();         // origin of a, seen in b, m
};

inline Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  // Normalised so that a long chain of products stays a rotation.
  return {(c_from_b.rotation * b_from_a.rotation).normalized(),
          c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

inline Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& p_a) {
  return b_from_a.rotation * p_a + b_from_a.translation;
}

inline Rigid3 inverse(const Rigid3& b_from_a) {
  const Eigen::Quaterniond a_from_b = b_from_a.rotation.conjugate();
  return {a_from_b, -(a_from_b * b_from_a.translation)};
}

// The same rotation with w >= 0, the sign every file carries.
inline Eigen::Quaterniond positive_w(const Eigen::Quaterniond& q) {
  return q.w() < 0 ? Eigen::Quaterniond(-q.w(), -q.x(), -q.y(), -q.z()) : q;
}

// Between a (s = 0) and b (s = 1): the translation linearly, the rotation along the shorter arc.
inline Rigid3 interpolate(const Rigid3& a, const Rigid3& b, double s) {
  return {a.rotation.slerp(s, b.rotation), (1 - s) * a.translation + s * b.translation};
}

}  // namespace perch
