#pragma once

#include <functional>

#include "calib/mount/sight_chain.h"

namespace perch {

struct MountProblem {
  MountChain chain;
  Rigid3 nominal_mount;               // where the drawing, or T_BS, says the camera is
  double nominal_offset = 0;          // s
  std::optional<Rigid3> nominal_pad;  // where the pad was surveyed; nothing is fitted to it
  std::vector<MountFlight> flights;
  MountOptions options;
};

// A flight as the solver knows it.
struct FlightFit {
  Trajectory trajectory;
  NavigationNoise noise;  // with every number known
  // One a sighting:
  std::vector<bool> used;      // false: an outlier, or without navigation
  std::vector<double> misfit;  // squared distance in its deviation, 6 degrees of freedom; NaN
  std::vector<std::optional<PoseError>> before, after;  // navigation minus vision in the world, m and rad
  double start_misfit = 0;                              // hand_eye_misfit's median at the start
};

struct OffsetCost {
  double offset = 0, cost = 0;  // s; chi-square per degree of freedom
};

struct MountSolution {
  MountState state;
  MountState start;  // as configured; pads that are not, where that puts them
  std::vector<FlightFit> flights;
  std::vector<OffsetCost> offset_costs;  // of the first flight, with everything else refitted by hand-eye
  // Of mount (d, r), pads (d, r), offsets, head: everything else eliminated, without the priors in it.
  Eigen::MatrixXd information;
  Eigen::MatrixXd prior_information;
  Eigen::MatrixXd covariance;  // of both together; infinite variances where there is nothing
  std::vector<std::string> names;
  double chi_square = 0;  // of the last problem
  double degrees = 0;     // its degrees of freedom
};

// Thrown when no mount explains the flight; says why, as far as that can be told.
class MountError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

using Say = std::function<void(const std::string&)>;

// 1. hand-eye over a grid of time offsets; 2. generalised least squares on poses with Cauchy's loss, then a
// chi-square gate; 3. one problem on the pixels, with the trajectory's corrections as states.
MountSolution solve_mount(const MountProblem& problem, const Say& say = {});

// The index into `state.pads` and `state.offsets` of a flight.
inline size_t pad_of_flight(const MountState& state, size_t flight) {
  return state.pads.size() == 1 ? 0 : flight;
}
inline size_t offset_of_flight(const MountState& state, size_t flight) {
  return state.offsets.size() == 1 ? 0 : flight;
}

}  // namespace perch
