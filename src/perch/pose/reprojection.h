#pragma once

#include <Eigen/Core>
#include <span>

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
using PixelJacobian = Eigen::Matrix<double, 2, 6>;

// The whitened reprojection error of one observation, (projected - seen) / sigma, and its derivative by (d,
// r) of (Exp(r) R, p + d) at zero. False when the point cannot be projected.
bool whitened_error(const CameraModel& camera, const Rigid3& camera_from_target,
                    const Observation& observation, Eigen::Vector2d* error, PixelJacobian* jacobian);

// The whole of it as ceres::TinySolver asks for it: 2 n residuals over (d, r) about `base`, through the full
// lens model, with Huber's loss. The parameters live in the tangent space of the manifold R3 x SO(3) at
// `base`.
class ReprojectionCost {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 6 };

  ReprojectionCost(const CameraModel& camera, std::span<const Observation> observations, const Rigid3& base,
                   double huber)
      : camera_(camera), observations_(observations), base_(base), huber_(huber) {}

  int NumResiduals() const { return 2 * static_cast<int>(observations_.size()); }

  // The pose at a parameter vector.
  Rigid3 pose(const PoseVector& x) const;

  // A point that cannot be projected makes every residual huge, so that the step is refused: a residual of
  // zero would teach the optimiser to throw points out of the picture.
  bool operator()(const double* parameters, double* residuals, double* jacobian) const;

 private:
  const CameraModel& camera_;
  std::span<const Observation> observations_;
  Rigid3 base_;
  double huber_;  // whitened distance from which the loss is linear
};

}  // namespace perch
