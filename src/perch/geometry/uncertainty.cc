#include "perch/geometry/uncertainty.h"

#include <Eigen/Cholesky>
#include <limits>

#include "perch/geometry/so3.h"

namespace perch {

PoseError pose_error(const Rigid3& estimate, const Rigid3& truth) {
  PoseError error;
  error << truth.translation - estimate.translation, so3_log(truth.rotation * estimate.rotation.conjugate());
  return error;
}

Rigid3 perturb(const Rigid3& pose, const PoseError& error) {
  return {(so3_exp(error.tail<3>()) * pose.rotation).normalized(), pose.translation + error.head<3>()};
}

UncertainRigid3 operator*(const UncertainRigid3& c_from_b, const UncertainRigid3& b_from_a) {
  const Eigen::Matrix3d R = c_from_b.mean.rotation.toRotationMatrix();
  PoseCovariance by_a = PoseCovariance::Identity();
  by_a.topRightCorner<3, 3>() = -skew(R * b_from_a.mean.translation);
  PoseCovariance by_b = PoseCovariance::Zero();
  by_b.topLeftCorner<3, 3>() = R;
  by_b.bottomRightCorner<3, 3>() = R;
  return {c_from_b.mean * b_from_a.mean,
          by_a * c_from_b.covariance * by_a.transpose() + by_b * b_from_a.covariance * by_b.transpose()};
}

UncertainRigid3 inverse(const UncertainRigid3& b_from_a) {
  // truth = (Exp(r) R, p + d). Its inverse has the rotation R^T Exp(-r) = Exp(-R^T r) R^T, and the
  // translation -R^T Exp(-r) (p + d) = -R^T p - R^T d + R^T [r]x p = p' - R^T d - R^T [p]x r to first order.
  const Rigid3 a_from_b = inverse(b_from_a.mean);
  const Eigen::Matrix3d Rt = a_from_b.rotation.toRotationMatrix();
  PoseCovariance by = PoseCovariance::Zero();
  by.topLeftCorner<3, 3>() = -Rt;
  by.topRightCorner<3, 3>() = -Rt * skew(b_from_a.mean.translation);
  by.bottomRightCorner<3, 3>() = -Rt;
  return {a_from_b, by * b_from_a.covariance * by.transpose()};
}

double normalised_error_squared(const PoseError& error, const PoseCovariance& covariance) {
  const Eigen::LLT<PoseCovariance> llt(covariance);
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
  return error.dot(llt.solve(error));
}

}  // namespace perch
