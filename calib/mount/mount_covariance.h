#pragma once

#include "calib/mount/pose_gate.h"

namespace perch {

// Fills in information, covariance, names and chi-square of the solution from the solved problem: everything
// but mount, pads, offsets and head is eliminated (Schur complement).
void measure_information(ceres::Problem& least_squares, UnknownBlocks& unknowns,
                         const std::vector<ceres::ResidualBlockId>& priors, const MountProblem& problem,
                         MountSolution& solution);

}  // namespace perch
