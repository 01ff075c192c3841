#pragma once

#include <memory>
#include <string>

#include "perch/camera/live_camera.h"

namespace perch {

// A GStreamer pipeline that ends in raw video; we add the conversion to grey (or to BGR when a channel is
// wanted) and an appsink that keeps the newest picture alone. `width` and `height` are demanded of the
// pipeline where they are given, for a lens model holds for its size; nothing is ever scaled.
//
// A picture's time is the pipeline's base time plus the buffer's running time, on CLOCK_MONOTONIC, which the
// pipeline is made to run by: for a live source that is when its data came in, however long decoding took.
// The pipeline's own latency is not waited for. A pipeline that is not live (a file) is played in real time.
// Its end and its errors are the device's breaking.
//
// Throws ConfigError when the description has a mistake (an element that is not installed, a property that
// there is not), or an option is given that a pipeline sets by itself.
std::unique_ptr<CameraDevice> make_gst_device(const std::string& pipeline, const LiveOptions& options,
                                              Channel channel);

}  // namespace perch
