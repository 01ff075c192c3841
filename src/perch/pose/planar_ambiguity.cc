#include "perch/pose/planar_ambiguity.h"

namespace perch {

Rigid3 mirrored_pose(const Rigid3& camera_from_target) {
  const Eigen::Vector3d v = camera_from_target.translation.normalized();
  const Eigen::Matrix3d R = camera_from_target.rotation.toRotationMatrix();
  const Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity() - 2 * v * v.transpose();
  // The mirror's determinant and that of the turned third axis are both -1.
  const Eigen::Matrix3d mirrored = mirror * R * Eigen::Vector3d(1, 1, -1).asDiagonal();
  return {Eigen::Quaterniond(mirrored).normalized(), camera_from_target.translation};
}

}  // namespace perch
