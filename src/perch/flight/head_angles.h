#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "perch/flight/flight.h"
#include "perch/frames/frame_chain.h"

namespace perch {

// What a pan/tilt/zoom camera said of itself, at a frame's time, between two samples linearly; before the
// first and after the last sample for at most a tenth of a second, empty beyond and across longer gaps: a
// head turns 80 deg/s.
std::optional<GimbalSample> gimbal_at(std::span<const GimbalSample> samples, int64_t camera_time_ns);
std::optional<HeadAngles> head_angles_at(std::span<const GimbalSample> samples, int64_t camera_time_ns);

}  // namespace perch
