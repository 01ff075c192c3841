#pragma once

#include <memory>
#include <string>

#include "perch/camera/live_camera.h"
#include "perch/camera/v4l2_kernel.h"

namespace perch {

// A camera of the kernel's, by V4L2's streaming into four mapped buffers; when several are full the newest
// counts.
//
// The format is the one asked for, or of those we read the first with the size and the rate that are wanted.
// The size must be as asked: a lens model holds for its size. A rate below the asked one is said and lived
// with.
//
// A picture's time is the driver's stamp on CLOCK_MONOTONIC, moved by half the exposure as the camera says it
// (asked again each second, for it may be automatic):
//   stamp at the start of the exposure (V4L2_BUF_FLAG_TSTAMP_SRC_SOE)   + exposure / 2
//   stamp at the end of the picture (…_EOF)                            - exposure / 2, and the readout:
//   options.latency
// A driver that has no such stamp gets the time of dequeuing, and a word about it.
//
// Throws ConfigError when `device` is no absolute path, or the format is none we read or has not the channel.
std::unique_ptr<CameraDevice> make_v4l2_device(const std::string& device, const LiveOptions& options,
                                               Channel channel, V4l2Kernel& kernel = the_kernel(),
                                               LiveClock& clock = monotonic_clock());

}  // namespace perch
