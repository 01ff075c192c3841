#pragma once

#include "calib/mount/mount_solver.h"

namespace perch {

// What a flight does not tell, in words, and what would.
struct Untold {
  std::string what;       // "lever arm z"
  double sigma = 0;       // m, rad or s
  double limit = 0;       // what it would have to be
  std::string trades;     // "trades with pad z"; empty where it is alone
  std::string manoeuvre;  // what would tell it
};

// From the covariance with the priors in it: what a prior tells is told.
std::vector<Untold> untold(const MountSolution& solution, const MountOptions& options);

// "lever arm z is known to 1.3 m only (limit 0.05 m): it trades with pad z. Fly with ..."
std::string in_words(const Untold& untold);

// The deviation that the mount's uncertainty gives a target's position in the body, when the camera sees it
// this far away along its axis: m, and the rotation's, rad.
struct MountEffect {
  double range = 0, position = 0, rotation = 0;
};
MountEffect mount_effect(const MountSolution& solution, const MountChain& chain, double range);

}  // namespace perch
