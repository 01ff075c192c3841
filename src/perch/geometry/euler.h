#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace perch {

// ZYX Euler angles, the paper's section 2.2.3: R = Rz(yaw) Ry(pitch) Rx(roll).
struct YawPitchRoll {
  double yaw = 0;    // theta_3, rad, (-pi, pi]
  double pitch = 0;  // theta_2, rad, [-pi/2, pi/2]
  double roll = 0;   // theta_1, rad, (-pi, pi]
};

Eigen::Quaterniond rotation_from_ypr(const YawPitchRoll& angles);

// At pitch = +-pi/2 yaw and roll turn about one axis: roll is then 0 and yaw takes all.
YawPitchRoll ypr_from_rotation(const Eigen::Quaterniond& rotation);

// The same angle in (-pi, pi].
double wrap_angle(double angle);

inline constexpr double kRadFromDeg = 0.017453292519943295;  // pi / 180
inline constexpr double kDegFromRad = 57.295779513082323;    // 180 / pi

}  // namespace perch
