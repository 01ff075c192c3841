#include "perch/geometry/euler.h"

#include <cmath>
#include <numbers>

namespace perch {

Eigen::Quaterniond rotation_from_ypr(const YawPitchRoll& angles) {
  return Eigen::AngleAxisd(angles.yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(angles.pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(angles.roll, Eigen::Vector3d::UnitX());
}

YawPitchRoll ypr_from_rotation(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d R = rotation.toRotationMatrix();
  const double cos_pitch = std::hypot(R(0, 0), R(1, 0));
  const double pitch = std::atan2(-R(2, 0), cos_pitch);
  // atan2 gives -pi for (-0, -1): wrap_angle makes it pi.
  // Rounding leaves about 1e-16 in place of a zero: closer than 1e-9 rad to the pole, roll means nothing.
  if (cos_pitch < 1e-9) return {wrap_angle(std::atan2(-R(0, 1), R(1, 1))), pitch, 0};
  const double yaw = wrap_angle(std::atan2(R(1, 0), R(0, 0)));
  // Roll from Rz(yaw)' R and not from the last row: near the pole yaw is off by up to 1e-16 / cos_pitch, and
  // roll then takes up just that, so that the rotation they make is exact to rounding.
  const double s = std::sin(yaw), c = std::cos(yaw);
  const double roll = std::atan2(s * R(0, 2) - c * R(1, 2), c * R(1, 1) - s * R(0, 1));
  return {yaw, pitch, wrap_angle(roll)};
}

double wrap_angle(double angle) {
  const double wrapped = std::remainder(angle, 2 * std::numbers::pi);
  return wrapped <= -std::numbers::pi ? std::numbers::pi : wrapped;
}

}  // namespace perch
