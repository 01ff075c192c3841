#pragma once

#include <ceres/problem.h>

#include "calib/mount/mount_solver.h"
#include "calib/mount/navigation_noise.h"
#include "calib/mount/sight_cost.h"

namespace perch {

// The unknowns as Ceres holds them.
class UnknownBlocks {
 public:
  explicit UnknownBlocks(const MountState& state);
  std::vector<double*> blocks(size_t flight, bool with_head);
  std::vector<double*> all(bool with_head);  // in the order of MountSolution::information
  double* mount() { return mount_.data(); }
  double* pad(size_t i) { return pads_[i].data(); }
  size_t pads() const { return pads_.size(); }
  double* offset(size_t i) { return &offsets_[i]; }
  size_t offsets() const { return offsets_.size(); }
  double* head() { return head_.data(); }
  void add_manifolds(ceres::Problem& problem, PoseManifold& manifold);
  MountState state(MountState state) const;

 private:
  PoseBlock mount_;
  std::vector<PoseBlock> pads_;
  std::vector<double> offsets_;
  HeadVector head_;
};

// What is known beforehand: the priors of the options, and of a head the drawing's 10 deg, 10 cm, 10 % and 50
// ms, so that what cannot be told stays where it is.
std::vector<ceres::ResidualBlockId> add_priors(const MountPriors& priors, UnknownBlocks& unknowns,
                                               ceres::Problem& problem);

// Generalised least squares on the poses, each whitened by its own covariance and navigation's. Finds the
// noise of navigation, the outliers (Cauchy's loss, then chi-square with 6 degrees of freedom at 0.999), and
// chooses between the two poses of a plane where the picture could not.
void pose_gate(MountProblem& problem, MountSolution& solution);

// Navigation minus vision, in the world; empty where there is none.
std::vector<std::optional<PoseError>> navigation_errors(const MountProblem& problem,
                                                        const MountFlight& flight, const FlightFit& fit,
                                                        const MountState& state, size_t f);

// The same of the solution's state with what it is made of: pictures that have a pose and navigation.
NoiseSamples noise_samples(const MountProblem& problem, const MountSolution& solution, size_t f);

}  // namespace perch
