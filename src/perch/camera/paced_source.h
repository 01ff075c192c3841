#pragma once

#include <memory>

#include "perch/camera/live_clock.h"
#include "perch/camera/live_source.h"

namespace perch {

// A recording as a live source: its pictures with their own stamps, each when it is due. In real time the
// first is due when it is asked for and each other as long after it as it was taken, but a gap of more than 5
// s is shortened to that: one row with a wrong time must not hold a replay up for hours. When the next
// picture is due before this one is given out, this one is dropped, as a camera's would be.
std::unique_ptr<LiveSource> pace_pictures(std::unique_ptr<ImageSource> pictures, Pace pace,
                                          LiveClock& clock = monotonic_clock());

}  // namespace perch
