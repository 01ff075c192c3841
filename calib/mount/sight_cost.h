#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <memory>

#include "calib/mount/sight_chain.h"

namespace perch {

// A pose as a parameter block: translation, then the quaternion x y z w. Its tangent is (d, r) of
// PoseCovariance, applied on the left. The costs below give their derivatives by (d, r) already, in the first
// six of seven columns, so PlusJacobian only picks these; it is right with such costs alone.
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

using PoseBlock = std::array<double, 7>;
PoseBlock block_of(const Rigid3& pose);
Rigid3 pose_of(const double* block);

// What a picture has to say about a predicted camera_from_target: whitened residuals, and their derivative by
// its (d, r).
class PictureTerm {
 public:
  virtual ~PictureTerm() = default;
  virtual int size() const = 0;
  virtual bool evaluate(const Rigid3& camera_from_target, double* residuals,
                        Eigen::Matrix<double, Eigen::Dynamic, 6>* jacobian) const = 0;
};

// The pose that was estimated, under a covariance; six residuals.
std::unique_ptr<PictureTerm> pose_term(const UncertainRigid3& camera_from_target);

// The reprojection of the target's points: two residuals each, through the full lens model. Weighed together
// so that they know as much about the pose as its own covariance says: corners drawn from fitted edges are
// not independent of each other.
std::unique_ptr<PictureTerm> pixel_term(const CameraModel& camera, const Sighting& sighting);

// A part of the correction of the trajectory: `weight` of a state.
struct CorrectionPart {
  double* state = nullptr;  // PoseError
  double weight = 1;
};

// A picture, through the chain. Blocks: mount (7), pad (7), offset (1), head (11, if the chain has one), then
// the correction's states (6 each).
class SightCost : public ceres::CostFunction {
 public:
  SightCost(const SightInputs& inputs, std::unique_ptr<PictureTerm> picture, std::vector<double> weights);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  SightInputs inputs_;
  std::unique_ptr<PictureTerm> picture_;
  std::vector<double> weights_;  // of the correction's states
};

// (sum_k a_k x_k - y) / sigma of states x_k (6): what navigation and the nature of its drift say about them.
class StatePrior : public ceres::CostFunction {
 public:
  StatePrior(std::vector<double> a, const Vector6d& y, const Vector6d& sigma);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  std::vector<double> a_;
  Vector6d y_, sigma_;
};

// (Log of pose about mean) / sigma: of a prior; infinite sigmas say nothing.
class PosePriorCost : public ceres::CostFunction {
 public:
  explicit PosePriorCost(const PosePrior& prior);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  PosePrior prior_;
};

}  // namespace perch
