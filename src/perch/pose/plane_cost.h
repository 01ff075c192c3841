#pragma once

#include <ceres/tiny_solver.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "perch/detection/detector.h"
#include "perch/geometry/rigid3.h"

namespace perch {

// A measured plane as every pose is compared with it.
struct WhitenedPlane {
  explicit WhitenedPlane(const PlaneMeasurement& measured);

  const PlaneMeasurement& measured;  // must outlive this
  Eigen::Matrix3d from_image;        // S
  Eigen::Matrix3d to_frame;          // H^-1 S^-1, of the measured homography
  PlaneInformation root;             // information = root' root
};

// The sum of squared distances of all measured edges from where a pose puts them, in their sigmas, above that
// of the homography they fit best: step' information step, with the step from that homography to the pose's.
// Eight residuals, however many edges there are, as ceres::TinySolver asks for them; the parameters are (d,
// r) about a base pose, which becomes (Exp(r) R, p + d).
class PlaneCost {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = 8, NUM_PARAMETERS = 6 };
  using Parameters = Eigen::Matrix<double, 6, 1>;
  using Jacobian = Eigen::Matrix<double, 8, 6>;

  // `plane` must outlive this.
  PlaneCost(const WhitenedPlane& plane, const Rigid3& base) : plane_(plane), base_(base) {}

  Rigid3 pose(const Parameters& x) const;

  // Whitened residuals at x and, unless null, their derivative (column-major). False when the target is not
  // before the camera.
  bool operator()(const double* parameters, double* residuals, double* jacobian) const;

 private:
  const WhitenedPlane& plane_;
  Rigid3 base_;
};

using PlaneSolver = ceres::TinySolver<PlaneCost, Eigen::LDLT<Eigen::Matrix<double, 6, 6>>>;

}  // namespace perch
