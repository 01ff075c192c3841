#pragma once

#include <string>

#include "perch/analysis/score.h"

namespace perch {

// A flight's errors for a terminal, in cm and degrees, several lines with a newline at the end:
//
//   dev_descent: 88 of 90 frames with a pose (97.8 %), 88 compared with navigation
//                RMS   DC offset   RMS without it       max
//   x          0.41 cm    +0.12 cm          0.39 cm   1.02 cm
//   ...
//
// Says so where there is nothing to compare with.
std::string error_table(const FlightScore& score);

}  // namespace perch
