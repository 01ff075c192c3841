#include "perch/pose/reprojection.h"

#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr double kUnprojectable =
    1e6;  // whitened; far above any real residual, far below overflow when squared

// Huber's loss as a factor on the residual: rho(s) = |f|^2 with f = g(s) e, s = |e|^2. Beyond `huber`,
// rho = 2 k sqrt(s) - k^2. `slope` is dg/ds.
double huber_factor(double s, double k, double* slope) {
  if (s <= k * k) {
    *slope = 0;
    return 1;
  }
  const double rho = 2 * k * std::sqrt(s) - k * k;
  const double g = std::sqrt(rho / s);
  *slope = (k / std::sqrt(s) * s - rho) / (2 * s * s * g);
  return g;
}

}  // namespace

bool whitened_error(const CameraModel& camera, const Rigid3& camera_from_target,
                    const Observation& observation, Eigen::Vector2d* error, PixelJacobian* jacobian) {
  const Eigen::Vector3d rotated = camera_from_target.rotation * observation.p_target;
  const Eigen::Vector3d p_camera = rotated + camera_from_target.translation;
  Matrix23d by_point;
  const auto pixel =
      jacobian ? camera.pixel_from_camera(p_camera, &by_point) : camera.pixel_from_camera(p_camera);
  if (!pixel) return false;
  const double weight = 1 / observation.sigma_px;
  *error = weight * (*pixel - observation.pixel);
  if (jacobian) {
    by_point *= weight;
    jacobian->leftCols<3>() = by_point;
    // d (Exp(r) v) / dr at 0 is -[v]x; a row times -[v]x is (v x row).
    jacobian->row(0).tail<3>() = rotated.cross(by_point.row(0).transpose()).transpose();
    jacobian->row(1).tail<3>() = rotated.cross(by_point.row(1).transpose()).transpose();
  }
  return true;
}

Rigid3 ReprojectionCost::pose(const PoseVector& x) const {
  return {so3_exp(x.tail<3>()) * base_.rotation, base_.translation + x.head<3>()};
}

bool ReprojectionCost::operator()(const double* parameters, double* residuals, double* jacobian) const {
  const Eigen::Map<const PoseVector> x(parameters);
  const Rigid3 camera_from_target = pose(x);
  const auto n = static_cast<Eigen::Index>(observations_.size());
  Eigen::Map<Eigen::VectorXd> r(residuals, 2 * n);
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6>> J(jacobian, jacobian ? 2 * n : 0, 6);
  // Exp(r + dr) = Exp(J_l(r) dr) Exp(r).
  const Eigen::Matrix3d left = jacobian ? so3_left_jacobian(x.tail<3>()) : Eigen::Matrix3d();

  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Vector2d error;
    PixelJacobian by_pose;
    if (!whitened_error(camera_, camera_from_target, observations_[static_cast<size_t>(i)], &error,
                        jacobian ? &by_pose : nullptr)) {
      r.setConstant(kUnprojectable);
      if (jacobian) J.setZero();
      return false;
    }
    double slope = 0;
    const double g = huber_factor(error.squaredNorm(), huber_, &slope);
    r.segment<2>(2 * i) = g * error;
    if (jacobian) {
      by_pose.rightCols<3>() = (by_pose.rightCols<3>() * left).eval();
      if (slope == 0) {
        J.middleRows<2>(2 * i) = by_pose;
      } else {
        const Eigen::Matrix2d by_error =
            g * Eigen::Matrix2d::Identity() + 2 * slope * error * error.transpose();
        J.middleRows<2>(2 * i) = by_error * by_pose;
      }
    }
  }
  return true;
}

}  // namespace perch
