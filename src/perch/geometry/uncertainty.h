#pragma once

#include <Eigen/Core>

#include "perch/geometry/rigid3.h"

namespace perch {

// The covariance of (d, r) = (dx, dy, dz, rx, ry, rz) with truth = (Exp(r) R, p + d), m and rad, both in the
// axes of the destination frame. Not the SE(3) adjoint of the textbooks: position and rotation are apart.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;
using PoseError = Eigen::Matrix<double, 6, 1>;

struct UncertainRigid3 {
  Rigid3 mean;
  PoseCovariance covariance = PoseCovariance::Zero();
};

// (d, r) of `truth` about `estimate`: truth = (Exp(r) R, p + d).
PoseError pose_error(const Rigid3& estimate, const Rigid3& truth);

// The pose with (d, r) applied: (Exp(r) R, p + d).
Rigid3 perturb(const Rigid3& pose, const PoseError& error);

// c_from_a = c_from_b * b_from_a, the two independent:
// d_c = d_a - [R_a p_b]x r_a + R_a d_b,  r_c = r_a + R_a r_b   (a = c_from_b, b = b_from_a).
UncertainRigid3 operator*(const UncertainRigid3& c_from_b, const UncertainRigid3& b_from_a);

// a_from_b of b_from_a: d' = -R^T d - R^T [p]x r,  r' = -R^T r.
UncertainRigid3 inverse(const UncertainRigid3& b_from_a);

// e' C^-1 e: the normalised (estimation) error squared; its mean is 6 for an honest pose covariance.
// NaN when the covariance is not positive definite.
double normalised_error_squared(const PoseError& error, const PoseCovariance& covariance);

}  // namespace perch
