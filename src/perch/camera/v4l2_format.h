#pragma once

#include <string>
#include <vector>

#include "perch/camera/live_source.h"
#include "perch/camera/v4l2_kernel.h"
#include "perch/camera/v4l2_pixels.h"

namespace perch {

struct V4l2Negotiated {
  V4l2Layout layout;
  std::string problem;  // what could not be had and is lived with: the rate
};

// Sets the first of the formats that the camera has with the size and the rate of the options; the first with
// the size when none has the rate. Throws std::runtime_error, with what the camera has instead, when there is
// none.
V4l2Negotiated negotiate_v4l2(V4l2Kernel& kernel, int fd, const std::vector<const V4l2PixelFormat*>& formats,
                              const LiveOptions& options);

}  // namespace perch
