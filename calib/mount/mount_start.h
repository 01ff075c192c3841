#pragma once

#include "calib/mount/hand_eye.h"
#include "calib/mount/mount_solver.h"

namespace perch {

// The pairs of a flight at a time offset, at most `most` of them, evenly chosen.
std::vector<HandEyePair> hand_eye_pairs(const MountProblem& problem, const MountFlight& flight,
                                        const Trajectory& trajectory, double offset, size_t most);

// A flight that the calibration can begin with, and where it begins.
struct FlightStart {
  Trajectory trajectory;
  HandEye hand_eye;
  double offset = 0;
  std::vector<OffsetCost> costs;
};

// Throws MountError naming the flight: no navigation, no common time, too few pictures, no motion, or nothing
// that fits; the last with what would make it fit, where a usual mistake does (perch-calibrate-mount's
// messages).
FlightStart start_flight(const MountProblem& problem, const MountFlight& flight);

}  // namespace perch
