#pragma once

#include "calib/mount/mount_solver.h"

namespace perch {

// How far apart the pictures of a flight put the pad in the world: it does not move, so this is what mount,
// clocks, navigation and vision leave.
struct PadScatter {
  size_t count = 0;
  double position = NAN, rotation = NAN;  // RMS of distances from the middle, m, and of angles, rad
};

// Of the pictures in `which` that have a pose. About `about`, or without it about their own middle.
PadScatter pad_scatter(const MountProblem& problem, const MountSolution& solution, size_t flight,
                       const MountState& state, const std::vector<bool>& which,
                       const Rigid3* about = nullptr);

// Of the used pictures, and of all, outliers too.
inline PadScatter pad_scatter(const MountProblem& problem, const MountSolution& solution, size_t flight,
                              const MountState& state) {
  return pad_scatter(problem, solution, flight, state, solution.flights[flight].used);
}
inline PadScatter whole_scatter(const MountProblem& problem, const MountSolution& solution, size_t flight) {
  return pad_scatter(problem, solution, flight, solution.state,
                     std::vector<bool>(problem.flights[flight].sightings.size(), true));
}

// The mount found without a third of the flights' pictures, and how it places the pad in that third.
struct HeldOut {
  std::string problem;               // why there is none; else empty
  double moved = NAN, turned = NAN;  // of the mount, from the one of all pictures: m and rad
  double moved_sigmas = NAN;  // the largest of the six, in deviations that leaving them out should have
  std::vector<PadScatter> within, beyond;  // a flight: of the pictures it was found from, and the others
};

// Each flight in nine pieces of time; every third piece is held out, three times. The parts are
// solved side by side.
std::vector<HeldOut> cross_validate(const MountProblem& problem, const MountSolution& solution);

}  // namespace perch
