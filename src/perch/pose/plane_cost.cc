#include "perch/pose/plane_cost.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

PlaneStep step_of(const Eigen::Matrix3d& N) {
  PlaneStep step;
  step << N(0, 0), N(0, 1), N(0, 2), N(1, 0), N(1, 1), N(1, 2), N(2, 0), N(2, 1);
  return step;
}

// The plane's homography of a pose, the first two columns of its rotation and its translation.
Eigen::Matrix3d homography_of(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) {
  Eigen::Matrix3d H;
  H << R.col(0), R.col(1), p;
  return H;
}

// A root of an information matrix that may be singular to rounding: from its eigenvalues.
PlaneInformation root_of(const PlaneInformation& information) {
  const Eigen::LLT<PlaneInformation> llt(information);
  if (llt.info() == Eigen::Success) return llt.matrixU();
  const Eigen::SelfAdjointEigenSolver<PlaneInformation> eigen(information);
  return eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

PlaneCost::PlaneCost(const PlaneMeasurement& plane, const Rigid3& base)
    : base_(base),
      from_image_(plane.frame.from_image()),
      to_frame_(plane.image_from_plane.inverse() * plane.frame.to_image()),
      root_(root_of(plane.information)) {}

Rigid3 PlaneCost::pose(const Parameters& x) const {
  if (x.isZero(0)) return base_;
  return {(so3_exp(x.tail<3>()) * base_.rotation).normalized(), base_.translation + x.head<3>()};
}

bool PlaneCost::operator()(const double* parameters, double* residuals, double* jacobian) const {
  const Parameters x(parameters);
  const Rigid3 at = pose(x);
  const Eigen::Matrix3d R = at.rotation.toRotationMatrix();
  const Eigen::Matrix3d N = from_image_ * homography_of(R, at.translation) * to_frame_;
  Eigen::Map<PlaneStep> f(residuals);
  if (!(at.translation.z() > 0) || !(std::abs(N(2, 2)) > 1e-12)) {
    f.setConstant(1e6);
    return false;
  }
  // By coefficients: Eigen's product for large matrices takes thrice as long for these.
  f = root_.lazyProduct(step_of(N / N(2, 2) - Eigen::Matrix3d::Identity()));
  if (!jacobian) return true;
  Eigen::Map<Jacobian> J(jacobian);
  Jacobian by_x;
  const Eigen::Matrix3d left = so3_left_jacobian(x.tail<3>());
  for (int i = 0; i < 6; ++i) {
    Eigen::Matrix3d by_i = Eigen::Matrix3d::Zero();
    if (i < 3) {
      by_i(i, 2) = 1;
    } else {
      const Eigen::Vector3d axis = left.col(i - 3);
      by_i.col(0) = axis.cross(R.col(0));
      by_i.col(1) = axis.cross(R.col(1));
    }
    const Eigen::Matrix3d dN = from_image_ * by_i * to_frame_;
    by_x.col(i) = step_of((dN - N * (dN(2, 2) / N(2, 2))) / N(2, 2));
  }
  J = root_.lazyProduct(by_x);
  return true;
}

}  // namespace perch
