#include "perch/pose/calibration_covariance.h"

#include <Eigen/Cholesky>

#include "perch/geometry/so3.h"

namespace perch {

PoseCovariance calibration_covariance(const CameraModel& camera, std::span<const Observation> features,
                                      const Rigid3& camera_from_target) {
  const Eigen::MatrixXd& covariance = camera.intrinsics_covariance();
  if (covariance.size() == 0) return PoseCovariance::Zero();
  using ByIntrinsics6 = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, CameraModel::kMostKnownIntrinsics>;
  PoseCovariance information = PoseCovariance::Zero();
  ByIntrinsics6 JtB = ByIntrinsics6::Zero(6, covariance.cols());
  CameraModel::ByIntrinsics B;
  for (const auto& feature : features) {
    const Eigen::Vector3d rotated = camera_from_target.rotation * feature.p_target;
    const Eigen::Vector3d p = rotated + camera_from_target.translation;
    Matrix23d by_point;
    if (!camera.pixel_from_camera(p, &by_point) || !camera.pixel_by_intrinsics(p, &B))
      return PoseCovariance::Zero();
    Eigen::Matrix<double, 2, 6> J;
    J << by_point, -by_point * skew(rotated);
    information.noalias() += J.transpose() * J;
    JtB.noalias() += J.transpose() * B;
  }
  const Eigen::LDLT<PoseCovariance> ldlt(information);
  const ByIntrinsics6 S = ldlt.solve(JtB);
  const ByIntrinsics6 S_covariance = S.lazyProduct(covariance);
  const PoseCovariance term = S_covariance.lazyProduct(S.transpose());
  if (!ldlt.isPositive() || !term.allFinite()) return PoseCovariance::Zero();
  return 0.5 * (term + term.transpose());
}

}  // namespace perch
