#pragma once

#include <optional>

#include "perch/camera/live_source.h"
#include "perch/camera/v4l2_kernel.h"

namespace perch {

// Sets exposure and gain where the options say, by hand then and not automatic, and lets no automatic
// exposure lower a rate that was asked for. Throws std::runtime_error when a camera lacks the control or its
// range does not reach so far.
void set_v4l2_controls(V4l2Kernel& kernel, int fd, const LiveOptions& options);

// The exposure as the camera says, s; nothing when it does not.
std::optional<double> v4l2_exposure(V4l2Kernel& kernel, int fd);

}  // namespace perch
