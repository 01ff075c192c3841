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
  // Rounding leaves about 1e-16 in place of a zero: closer than 1e-9 rad to the pole, roll means nothing.
  if (cos_pitch < 1e-9) {
    return {std::atan2(-R(0, 1), R(1, 1)), std::atan2(-R(2, 0), cos_pitch), 0};
  }
  return {std::atan2(R(1, 0), R(0, 0)), std::atan2(-R(2, 0), cos_pitch), std::atan2(R(2, 1), R(2, 2))};
}

double wrap_angle(double angle) {
  const double wrapped = std::remainder(angle, 2 * std::numbers::pi);
  return wrapped <= -std::numbers::pi ? std::numbers::pi : wrapped;
}

}  // namespace perch
