#pragma once

#include <span>
#include <vector>

#include "perch/geometry/rigid3.h"

namespace perch {

// The robot-world/hand-eye problem: world_from_body_i * mount * base_from_pad_i = pad for all i.
struct HandEyePair {
  Rigid3 world_from_body, base_from_pad;
};

struct HandEye {
  Rigid3 mount, pad;
  double misfit = INFINITY;  // median over the pairs, see hand_eye_misfit
};

// How far a pair is off: the angle in degrees and the distance in units of 3 cm + 1 % of the range, as one
// length. A hundred: nothing fits.
double hand_eye_misfit(const HandEyePair& pair, const Rigid3& mount, const Rigid3& pad);
double median_misfit(std::span<const HandEyePair> pairs, const Rigid3& mount, const Rigid3& pad);

// Rotations by Shah (Solving the robot-world/hand-eye calibration problem using the Kronecker product, 2013):
// sum of R_K' (x) R_W has vec(R_pad) and vec(R_mount) as its first singular vectors. Translations by linear
// least squares. Where the vehicle hardly turns the rotations follow from the path instead (Procrustes).
// Each is tried on all pairs and on random handfuls of them, so that a third of wrong poses does no harm, and
// `nominal` is tried too; the one with the least median misfit wins. OpenCV's calibrateHandEye (TSAI, HORAUD,
// DANIILIDIS) fails on cameras that look straight down, at rotations of 180 degrees; this form does not.
HandEye solve_hand_eye(std::span<const HandEyePair> pairs, const Rigid3& nominal);

// The pad that suits a mount best: the middle of where the pairs put it.
Rigid3 pad_of(std::span<const HandEyePair> pairs, const Rigid3& mount);

}  // namespace perch
