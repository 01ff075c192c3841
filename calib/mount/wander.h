#pragma once

#include "calib/mount/mount_solver.h"

namespace perch {

// Whether navigation minus vision still wanders when all is fitted, slower than the noise in the model does.
// Noise averages out over thousands of pictures and a wandering receiver does not: what the model does not
// know of it makes the stated deviations too small. Seen in the means over pieces of the flight; what lasts
// for the whole flight is not, as it is the pad's place.
struct Wander {
  double piece = 0;                   // s
  double position = 1, rotation = 1;  // RMS of the pieces' means over what the noise model gives them
  double position_rest = 0, rotation_rest = 0;  // what is not explained, a deviation, m and rad
};

// 1 where there are too few pictures to tell.
Wander wander(const MountProblem& problem, const MountSolution& solution, size_t flight);

// What to do about it; empty where it is not more than chance makes.
std::string in_words(const Wander& wander);

}  // namespace perch
