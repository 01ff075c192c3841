#include "calib/mount/sight_cost.h"

#include <Eigen/Dense>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

using RowMajor7 = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>>;
using RowMajor6 = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>>;

// d pose_error(estimate, x) by x's (d, r).
Matrix6d error_by_pose(const PoseError& error) {
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() = so3_left_jacobian(error.tail<3>()).inverse();
  return J;
}

class PoseTerm : public PictureTerm {
 public:
  explicit PoseTerm(const UncertainRigid3& pose) : seen_(pose.mean) {
    whiten_ = pose.covariance.llt().matrixL().solve(Matrix6d::Identity());
  }
  int size() const override { return 6; }
  bool evaluate(const Rigid3& camera_from_target, double* residuals,
                Eigen::Matrix<double, Eigen::Dynamic, 6>* jacobian) const override {
    const PoseError error = pose_error(seen_, camera_from_target);
    Eigen::Map<Vector6d> r(residuals);
    r = whiten_ * error;
    if (jacobian) *jacobian = whiten_ * error_by_pose(error);
    return r.allFinite();
  }

 private:
  Rigid3 seen_;
  Matrix6d whiten_;
};

class PixelTerm : public PictureTerm {
 public:
  PixelTerm(const CameraModel& camera, const Sighting& sighting)
      : camera_(camera), observations_(sighting.observations) {
    Matrix6d information = Matrix6d::Zero();
    const UncertainRigid3& pose = *sighting.camera_from_target;
    for (const Observation& o : observations_) {
      Eigen::Vector2d error;
      PixelJacobian J;
      if (whitened_error(camera_, pose.mean, o, &error, &J)) information += J.transpose() * J;
    }
    const double spread = (pose.covariance * information).trace() / 6;
    if (spread > 0 && std::isfinite(spread)) weight_ = 1 / std::sqrt(spread);
  }
  int size() const override { return 2 * static_cast<int>(observations_.size()); }
  bool evaluate(const Rigid3& camera_from_target, double* residuals,
                Eigen::Matrix<double, Eigen::Dynamic, 6>* jacobian) const override {
    if (jacobian) jacobian->resize(size(), 6);
    for (size_t i = 0; i < observations_.size(); ++i) {
      Eigen::Vector2d error;
      PixelJacobian J;
      if (!whitened_error(camera_, camera_from_target, observations_[i], &error, &J)) return false;
      const auto row = 2 * static_cast<Eigen::Index>(i);
      Eigen::Map<Eigen::Vector2d>(residuals + row) = weight_ * error;
      if (jacobian) jacobian->middleRows<2>(row) = weight_ * J;
    }
    return true;
  }

 private:
  CameraModel camera_;
  std::vector<Observation> observations_;
  double weight_ = 1;
};

}  // namespace

PoseBlock block_of(const Rigid3& pose) {
  const auto& t = pose.translation;
  const auto& q = pose.rotation;
  return {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
}

Rigid3 pose_of(const double* b) {
  return {Eigen::Quaterniond(b[6], b[3], b[4], b[5]), Eigen::Vector3d(b[0], b[1], b[2])};
}

bool PoseManifold::Plus(const double* x, const double* delta, double* out) const {
  const PoseBlock moved = block_of(perturb(pose_of(x), PoseError(delta)));
  std::copy(moved.begin(), moved.end(), out);
  return true;
}

bool PoseManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> J(jacobian);
  J.setZero();
  J.topRows<6>().setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* out) const {
  Eigen::Map<Vector6d> d(out);
  d = pose_error(pose_of(x), pose_of(y));
  return true;
}

bool PoseManifold::MinusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> J(jacobian);
  J.setZero();
  J.leftCols<6>().setIdentity();
  return true;
}

std::unique_ptr<PictureTerm> pose_term(const UncertainRigid3& camera_from_target) {
  return std::make_unique<PoseTerm>(camera_from_target);
}

std::unique_ptr<PictureTerm> pixel_term(const CameraModel& camera, const Sighting& sighting) {
  return std::make_unique<PixelTerm>(camera, sighting);
}

SightCost::SightCost(const SightInputs& inputs, std::unique_ptr<PictureTerm> picture,
                     std::vector<double> weights)
    : inputs_(inputs), picture_(std::move(picture)), weights_(std::move(weights)) {
  set_num_residuals(picture_->size());
  auto* sizes = mutable_parameter_block_sizes();
  *sizes = {7, 7, 1};
  if (inputs_.chain.head) sizes->push_back(kHeadSize);
  sizes->resize(sizes->size() + weights_.size(), 6);
}

bool SightCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const size_t states = inputs_.chain.head ? 4 : 3;
  HeadVector head = HeadVector::Zero();
  if (states == 4) head = HeadVector(parameters[3]);
  Vector6d correction = Vector6d::Zero();
  for (size_t k = 0; k < weights_.size(); ++k)
    correction += weights_[k] * Eigen::Map<const Vector6d>(parameters[states + k]);
  const auto sight = predict_sight(inputs_, pose_of(parameters[0]), pose_of(parameters[1]), *parameters[2],
                                   head, correction);
  if (!sight) return false;
  Eigen::Matrix<double, Eigen::Dynamic, 6> J;
  if (!picture_->evaluate(sight->camera_from_target, residuals, jacobians ? &J : nullptr)) return false;
  if (!jacobians) return true;
  const int n = num_residuals();
  for (const size_t k : {size_t{0}, size_t{1}}) {
    if (!jacobians[k]) continue;
    RowMajor7 by(jacobians[k], n, 7);
    by.leftCols<6>() = J * (k == 0 ? sight->by_mount : sight->by_pad);
    by.col(6).setZero();
  }
  if (jacobians[2]) Eigen::Map<Eigen::VectorXd>(jacobians[2], n) = J * sight->by_offset;
  if (states == 4 && jacobians[3]) {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, kHeadSize, Eigen::RowMajor>>(
        jacobians[3], n, kHeadSize) = J * sight->by_head;
  }
  for (size_t k = 0; k < weights_.size(); ++k) {
    if (jacobians[states + k])
      RowMajor6(jacobians[states + k], n, 6) = weights_[k] * (J * sight->by_correction);
  }
  return true;
}

StatePrior::StatePrior(std::vector<double> a, const Vector6d& y, const Vector6d& sigma)
    : a_(std::move(a)), y_(y), sigma_(sigma) {
  set_num_residuals(6);
  mutable_parameter_block_sizes()->assign(a_.size(), 6);
}

bool StatePrior::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  Vector6d sum = -y_;
  for (size_t k = 0; k < a_.size(); ++k) sum += a_[k] * Eigen::Map<const Vector6d>(parameters[k]);
  Eigen::Map<Vector6d>(residuals, 6) = sum.cwiseQuotient(sigma_);
  for (size_t k = 0; jacobians && k < a_.size(); ++k) {
    if (!jacobians[k]) continue;
    RowMajor6(jacobians[k], 6, 6) = Matrix6d((a_[k] * sigma_.cwiseInverse()).asDiagonal());
  }
  return true;
}

PosePriorCost::PosePriorCost(const PosePrior& prior) : prior_(prior) {
  set_num_residuals(6);
  *mutable_parameter_block_sizes() = {7};
}

bool PosePriorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const PoseError error = pose_error(prior_.mean, pose_of(parameters[0]));
  Vector6d weight;
  weight << prior_.position_sigma.cwiseInverse(), prior_.rotation_sigma.cwiseInverse();
  Eigen::Map<Vector6d>(residuals, 6) = weight.cwiseProduct(error);
  if (jacobians && jacobians[0]) {
    RowMajor7 J(jacobians[0], 6, 7);
    J.leftCols<6>() = weight.asDiagonal() * error_by_pose(error);
    J.col(6).setZero();
  }
  return true;
}

}  // namespace perch
