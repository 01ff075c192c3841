#include "perch/pose/reprojection.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr double kUnprojectable = 1e12;  // far above any real sum, far below overflow

// whitened_error with the rotation as a matrix, which for many points is the faster.
bool whitened_error_at(const CameraModel& camera, const Eigen::Matrix3d& R, const Eigen::Vector3d& p,
                       const Observation& observation, Eigen::Vector2d* error, PixelJacobian* jacobian) {
  const Eigen::Vector3d rotated = R * observation.p_target;
  const Eigen::Vector3d p_camera = rotated + p;
  Matrix23d by_point;
  const auto pixel = camera.pixel_from_camera(p_camera, jacobian ? &by_point : nullptr);
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

void add_derivatives(const Eigen::Vector2d& error, const PixelJacobian& J, double huber, LossSum* sum) {
  const double distance = error.norm();
  if (distance <= huber) {
    sum->half_gradient.noalias() += J.transpose() * error;
    sum->half_curvature.noalias() += J.transpose() * J;
    return;
  }
  const double weight = huber / distance;
  const Eigen::Vector2d across(-error.y() / distance, error.x() / distance);
  const PoseVector J_across = J.transpose() * across;
  sum->half_gradient.noalias() += J.transpose() * (weight * error);
  sum->half_curvature.noalias() += (weight * J_across) * J_across.transpose();
}

// The upper triangle U of H = U'U and y = U'^-1 g. A direction in which H has nothing (to rounding) beyond
// what the ones before it have is left zero in both.
void factorise(const LossSum& sum, Eigen::Map<Eigen::Matrix<double, 7, 6>>& U,
               Eigen::Map<Eigen::Matrix<double, 7, 1>>& y) {
  for (Eigen::Index i = 0; i < 6; ++i) {
    const auto above = U.col(i).head(i);
    const double square = sum.half_curvature(i, i) - above.squaredNorm();
    if (!(square > 0)) continue;
    const double pivot = std::sqrt(square);
    U(i, i) = pivot;
    for (Eigen::Index k = i + 1; k < 6; ++k) {
      U(i, k) = (sum.half_curvature(i, k) - above.dot(U.col(k).head(i))) / pivot;
    }
    y(i) = (sum.half_gradient(i) - above.dot(y.head(i))) / pivot;
  }
}

}  // namespace

bool whitened_error(const CameraModel& camera, const Rigid3& camera_from_target,
                    const Observation& observation, Eigen::Vector2d* error, PixelJacobian* jacobian) {
  return whitened_error_at(camera, camera_from_target.rotation.toRotationMatrix(),
                           camera_from_target.translation, observation, error, jacobian);
}

double huber_loss(double distance, double huber) {
  return distance <= huber ? distance * distance : huber * (2 * distance - huber);
}

void ReprojectionErrors::observe(std::span<const Observation> observations) {
  observations_.assign(observations.begin(), observations.end());
  errors_.clear();
}

std::span<const ReprojectionErrors::Error> ReprojectionErrors::at(const Rigid3& camera_from_target) {
  const bool held = !errors_.empty() && camera_from_target.translation == camera_from_target_.translation &&
                    camera_from_target.rotation.coeffs() == camera_from_target_.rotation.coeffs();
  if (held) return errors_;
  camera_from_target_ = camera_from_target;
  errors_.resize(observations_.size());
  const Eigen::Matrix3d R = camera_from_target.rotation.toRotationMatrix();
  for (size_t i = 0; i < observations_.size(); ++i) {
    if (!whitened_error_at(camera_, R, camera_from_target.translation, observations_[i], &errors_[i].error,
                           &errors_[i].jacobian)) {
      errors_.clear();
      break;
    }
  }
  return errors_;
}

Rigid3 ReprojectionCost::pose(const PoseVector& x) const {
  if (x.isZero(0)) return base_;
  return {(so3_exp(x.tail<3>()) * base_.rotation).normalized(), base_.translation + x.head<3>()};
}

bool ReprojectionCost::sum(const PoseVector& x, bool derivatives, LossSum* sum) const {
  *sum = {};
  const auto errors = errors_.at(pose(x));
  if (errors.empty()) {
    sum->value = kUnprojectable;
    return false;
  }
  for (const auto& [error, jacobian] : errors) {
    sum->value += huber_loss(error.norm(), huber_);
    if (derivatives) add_derivatives(error, jacobian, huber_, sum);
  }
  if (derivatives && !x.isZero(0)) {
    // Exp(r + dr) = Exp(J_l(r) dr) Exp(r).
    const Eigen::Matrix3d left = so3_left_jacobian(x.tail<3>());
    auto& H = sum->half_curvature;
    H.rightCols<3>() = (H.rightCols<3>() * left).eval();
    H.bottomRows<3>() = (left.transpose() * H.bottomRows<3>()).eval();
    sum->half_gradient.tail<3>() = (left.transpose() * sum->half_gradient.tail<3>()).eval();
  }
  return true;
}

bool ReprojectionCost::operator()(const double* parameters, double* residuals, double* jacobian) const {
  LossSum at;
  const bool projected = sum(PoseVector(parameters), jacobian != nullptr, &at);
  Eigen::Map<Eigen::Matrix<double, 7, 1>> f(residuals);
  f.setZero();
  if (jacobian) {
    Eigen::Map<Eigen::Matrix<double, 7, 6>> J(jacobian);
    J.setZero();
    factorise(at, J, f);
    // The full step would gain more than there is: too flat a curvature, with most errors beyond the bound.
    // As many times steeper, and f'f is right again.
    const double excess = f.squaredNorm() / at.value;
    if (excess > 1) {
      J *= std::sqrt(excess);
      f /= std::sqrt(excess);
    }
  }
  f(6) = std::sqrt(std::max(0.0, at.value - f.squaredNorm()));
  return projected;
}

}  // namespace perch
