#pragma once

#include "calib/mount/pose_gate.h"

namespace perch {

// Throws MountError unless a problem is at its minimum: another step of least squares would have to gain less
// than `gain` in chi-square; 1 is a deviation. Ceres calls a solve usable whose every step was refused.
void check_converged(ceres::Problem& least_squares, const std::string& on, double gain);

// The inverse, with variances that show where there is nothing to invert.
Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& information);

// Fills in information, covariance, names and chi-square of the solution from the solved problem: everything
// but mount, pads, offsets and head is eliminated (Schur complement).
void measure_information(ceres::Problem& least_squares, UnknownBlocks& unknowns,
                         const std::vector<ceres::ResidualBlockId>& priors, const MountProblem& problem,
                         MountSolution& solution);

}  // namespace perch
