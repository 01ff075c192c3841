#pragma once

#include "calib/mount/mount_start.h"

namespace perch {

// Conventions that recordings get wrong. A wrong one fits no mount, or one much worse than the right one.

// The change that makes navigation fit far better than it does as recorded, in words; empty: none.
std::string usual_mistake(const MountProblem& problem, const MountFlight& flight, const FlightStart& start);

// The same for a flight that does not fit: also says so when no change helps.
std::string explain_misfit(const MountProblem& problem, const MountFlight& flight, const FlightStart& start);

}  // namespace perch
