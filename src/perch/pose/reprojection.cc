#include "perch/pose/reprojection.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr double kUnprojectable = 1e12;  // far above any real sum, far below overflow

// From a projection to the whitened error. `rotated` is the point in the camera's axes but from the target's
// origin.
inline void whiten(const Eigen::Vector2d& pixel, const Matrix23d& by_point, const Eigen::Vector3d& rotated,
                   const Observation& observation, Eigen::Vector2d* error, PixelJacobian* jacobian) {
  const double weight = 1 / observation.sigma_px;
  *error = weight * (pixel - observation.pixel);
  for (int i = 0; i < 2; ++i) {
    const double x = weight * by_point(i, 0), y = weight * by_point(i, 1), z = weight * by_point(i, 2);
    // d (Exp(r) v) / dr at 0 is -[v]x; a row times -[v]x is (v x row).
    jacobian->row(i) << x, y, z, rotated.y() * z - rotated.z() * y, rotated.z() * x - rotated.x() * z,
        rotated.x() * y - rotated.y() * x;
  }
}

// The upper triangle of half the curvature, the rest of which is its mirror image.
void add_derivatives(const Eigen::Vector2d& error, const PixelJacobian& J, double huber, LossSum* sum) {
  const double distance = error.norm();
  if (distance <= huber) {
    sum->half_gradient.noalias() += J.transpose() * error;
    for (int i = 0; i < 6; ++i) {
      for (int k = 0; k <= i; ++k) sum->half_curvature(k, i) += J(0, k) * J(0, i) + J(1, k) * J(1, i);
    }
    return;
  }
  const double weight = huber / distance;
  const Eigen::Vector2d across(-error.y() / distance, error.x() / distance);
  const PoseVector J_across = J.transpose() * across;
  sum->half_gradient.noalias() += J.transpose() * (weight * error);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k <= i; ++k) sum->half_curvature(k, i) += (weight * J_across(k)) * J_across(i);
  }
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
  const Eigen::Matrix3d R = camera_from_target.rotation.toRotationMatrix();  // as below, to the last bit
  const Eigen::Vector3d rotated = R * observation.p_target;
  Matrix23d by_point;
  const auto pixel = camera.pixel_from_camera(rotated + camera_from_target.translation, &by_point);
  if (!pixel) return false;
  PixelJacobian unwanted;
  whiten(*pixel, by_point, rotated, observation, error, jacobian ? jacobian : &unwanted);
  return true;
}

double huber_loss(double distance, double huber) {
  return distance <= huber ? distance * distance : huber * (2 * distance - huber);
}

void ReprojectionErrors::observe(std::span<const Observation> observations) {
  observations_.assign(observations.begin(), observations.end());
  errors_.clear();
  rotated_.resize(observations.size());
  points_camera_.resize(observations.size());
  pixels_.resize(observations.size());
  by_point_.resize(observations.size());
}

std::span<const ReprojectionErrors::Error> ReprojectionErrors::at(const Rigid3& camera_from_target) {
  const bool held = !errors_.empty() && camera_from_target.translation == camera_from_target_.translation &&
                    camera_from_target.rotation.coeffs() == camera_from_target_.rotation.coeffs();
  if (held) return errors_;
  camera_from_target_ = camera_from_target;
  const Eigen::Matrix3d R = camera_from_target.rotation.toRotationMatrix();
  for (size_t i = 0; i < observations_.size(); ++i) {
    rotated_[i] = R * observations_[i].p_target;
    points_camera_[i] = rotated_[i] + camera_from_target.translation;
  }
  errors_.clear();
  if (!camera_.pixels_from_camera(points_camera_, pixels_, by_point_)) return errors_;
  errors_.resize(observations_.size());
  for (size_t i = 0; i < observations_.size(); ++i) {
    auto& [error, jacobian] = errors_[i];
    whiten(pixels_[i], by_point_[i], rotated_[i], observations_[i], &error, &jacobian);
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
  if (!derivatives) return true;
  sum->half_curvature.triangularView<Eigen::StrictlyLower>() = sum->half_curvature.transpose();
  if (!x.isZero(0)) {
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
