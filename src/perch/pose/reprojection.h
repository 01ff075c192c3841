#pragma once

#include <ceres/tiny_solver.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/geometry/rigid3.h"

namespace perch {

// A point of the target and where it was seen.
struct Observation {
  Eigen::Vector3d p_target = Eigen::Vector3d::Zero();  // m
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 1;
};

using PoseVector = Eigen::Matrix<double, 6, 1>;  // (d, r): the pose is (Exp(r) R0, p0 + d)
using PixelJacobian = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

// The whitened reprojection error of one observation, (projected - seen) / sigma, and its derivative by (d,
// r) of (Exp(r) R, p + d) at zero. False when the point cannot be projected.
bool whitened_error(const CameraModel& camera, const Rigid3& camera_from_target,
                    const Observation& observation, Eigen::Vector2d* error, PixelJacobian* jacobian);

// The whitened errors of all observations at one pose. It is kept: what asks again at the same pose (the
// derivative after the value, the next descent after the one before, the covariance at the end) has it for
// nothing, which halves the time of an estimate.
class ReprojectionErrors {
 public:
  struct Error {
    Eigen::Vector2d error;
    PixelJacobian jacobian;  // as of whitened_error
  };

  explicit ReprojectionErrors(const CameraModel& camera) : camera_(camera) {}

  void observe(std::span<const Observation> observations);
  std::span<const Observation> observations() const { return observations_; }

  // One for each observation, until the next call; none when a point cannot be projected.
  std::span<const Error> at(const Rigid3& camera_from_target);

 private:
  CameraModel camera_;
  std::vector<Observation> observations_;
  std::vector<Error> errors_;
  std::vector<Eigen::Vector3d> rotated_, points_camera_;  // working memory, as are the next two
  std::vector<Eigen::Vector2d> pixels_;
  std::vector<Matrix23d> by_point_;
  Rigid3 camera_from_target_;  // where errors_ are; anywhere when there are none
};

// Huber's loss of a distance: its square up to `huber`, from there on 2 huber distance - huber^2.
double huber_loss(double distance, double huber);

// The sum of Huber's loss over all observations, a function of (d, r) about `base`, through the full lens
// model: its value, half its gradient J'f, and half its curvature, in which the errors count as linear in the
// pose (Gauss and Newton) but the loss keeps its own: beyond the bound it is bent only across the error.
// Taking the loss for the square of a scaled error instead, as one does who has residuals only, converges
// three times slower.
struct LossSum {
  double value = 0;
  PoseVector half_gradient = PoseVector::Zero();
  Eigen::Matrix<double, 6, 6> half_curvature = Eigen::Matrix<double, 6, 6>::Zero();
};

// That sum as ceres::TinySolver asks for it. The solver looks at residuals f and their derivative J only
// through f'f, J'f and J'J, so seven residuals do for any number of observations: from the Cholesky factor L
// of the curvature, J = [L'; 0] and f = [L^-1 J'f; what is left of f'f]. Nothing is allocated, and a step
// costs half. The parameters live in the tangent space of the manifold R3 x SO(3) at `base`.
class ReprojectionCost {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = 7, NUM_PARAMETERS = 6 };

  ReprojectionCost(ReprojectionErrors& errors, const Rigid3& base, double huber)
      : errors_(errors), base_(base), huber_(huber) {}

  // The pose at a parameter vector; at zero the base to the last bit.
  Rigid3 pose(const PoseVector& x) const;

  // The sum at x; without `derivatives` its value alone. False when a point cannot be projected: the value is
  // then huge, so that the step is refused: a value without that point would teach the optimiser to throw
  // points out of the picture.
  bool sum(const PoseVector& x, bool derivatives, LossSum* sum) const;

  // Column-major 7 x 6 `jacobian`, or null. False as above. Without the derivative only f'f is right.
  bool operator()(const double* parameters, double* residuals, double* jacobian) const;

 private:
  ReprojectionErrors& errors_;
  Rigid3 base_;
  double huber_;  // whitened distance from which the loss is linear
};

// Cholesky without pivoting: the damping keeps the matrix definite, and where rounding does not, the step is
// no improvement and refused.
using PoseSolver = ceres::TinySolver<ReprojectionCost, Eigen::LLT<Eigen::Matrix<double, 6, 6>>>;

}  // namespace perch
