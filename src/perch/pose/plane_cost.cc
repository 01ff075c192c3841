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

WhitenedPlane::WhitenedPlane(const PlaneMeasurement& plane)
    : measured(plane),
      from_image(plane.frame.from_image()),
      to_frame(plane.image_from_plane.inverse() * plane.frame.to_image()),
      root(root_of(plane.information)) {}

Rigid3 PlaneCost::pose(const Parameters& x) const {
  if (x.isZero(0)) return base_;
  return {(so3_exp(x.tail<3>()) * base_.rotation).normalized(), base_.translation + x.head<3>()};
}

bool PlaneCost::operator()(const double* parameters, double* residuals, double* jacobian) const {
  const Parameters x(parameters);
  const Rigid3 at = pose(x);
  const Eigen::Matrix3d R = at.rotation.toRotationMatrix();
  const auto& [measured, from_image, to_frame, root] = plane_;
  const Eigen::Matrix3d N = from_image * homography_of(R, at.translation) * to_frame;
  Eigen::Map<PlaneStep> f(residuals);
  if (!(at.translation.z() > 0) || !(std::abs(N(2, 2)) > 1e-12)) {
    f.setConstant(1e6);
    return false;
  }
  // By coefficients: Eigen's product for large matrices takes thrice as long for these.
  f = root.lazyProduct(step_of(N / N(2, 2) - Eigen::Matrix3d::Identity()));
  if (!jacobian) return true;
  Eigen::Map<Jacobian> J(jacobian);
  Jacobian by_x;
  const Eigen::Matrix3d left = so3_left_jacobian(x.tail<3>());
  for (int i = 0; i < 6; ++i) {
    // Of the homography a translation moves the last column, a rotation the first two.
    Eigen::Matrix3d dN;
    if (i < 3) {
      dN = from_image.col(i) * to_frame.row(2);
    } else {
      const Eigen::Vector3d axis = left.col(i - 3);
      dN = (from_image * axis.cross(R.col(0))) * to_frame.row(0) +
           (from_image * axis.cross(R.col(1))) * to_frame.row(1);
    }
    by_x.col(i) = step_of((dN - N * (dN(2, 2) / N(2, 2))) / N(2, 2));
  }
  J = root.lazyProduct(by_x);
  return true;
}

}  // namespace perch
