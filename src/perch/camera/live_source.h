#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "perch/camera/image_source.h"

namespace perch {

// A picture as a live source gives it. All times of a camera are ns on CLOCK_MONOTONIC.
struct LiveFrame {
  Frame frame;  // timestamp_ns: middle of the exposure; of a recording, the recording's own (recorded() says
                // so)
  int64_t arrived_ns = 0;  // when this process had it, always on CLOCK_MONOTONIC
};

// When a recording gives its pictures: as far apart as they were taken, those leaving out that come too fast
// for whoever asks; or each at once when it is asked for, none left out.
enum class Pace { kRealTime, kFast };

// Of these a recording heeds `pace` alone: the others say what a camera is to do, and it has done it.
struct LiveOptions {
  int width = 0, height = 0;  // px; 0: as the source has it
  double rate_hz = 0;         // 0: as the source has it
  std::string format;         // v4l2: the pixel format, such as GREY, YUYV, MJPG; empty: the best there is
  std::optional<double> exposure;  // v4l2: s; nothing: as the camera is set
  std::optional<double> gain;      // v4l2: in the unit of the camera's own control
  // How late the source's stamp is, for sources that cannot say: s from the middle of the exposure to a
  // pipeline's stamp, s from the start or the end of the exposure to a stamp that is meant to be that moment.
  double latency = 0;
  Pace pace = Pace::kRealTime;

  // Without a picture for so long a camera is opened anew. 0: ten periods, half a second at least.
  double stall = 0;
  // The first picture after opening may take longer: an RTSP server waits for a key frame.
  double first_picture = 5;  // s
};

struct LiveCounters {
  int64_t frames = 0;        // given out by next(), unreadable ones included
  int64_t dropped = 0;       // lost on the way: gaps in the camera's own numbers, broken ones, too late ones
  int64_t settling = 0;      // left out while the sender's clock was being matched to ours
  int64_t reopened = 0;      // opened again with success
  int64_t open_failed = 0;   // attempts to open without success
  int64_t resized = 0;       // pictures of another size than the one before
  int64_t stalled = 0;       // times when no picture came for too long
  std::string last_problem;  // what was wrong last; empty: nothing yet
};

// Pictures as they are taken. A camera that stops, vanishes or changes its size is no error: it is opened
// again, with back-off from 0.1 s to 5 s, for as long as it takes. One thread calls next(); others may call
// the rest.
class LiveSource {
 public:
  virtual ~LiveSource() = default;
  // Waits at most `timeout` for the next picture; nothing: none came, perhaps since the source is being
  // reopened. Stamps increase strictly. Buffers are reused: the pixels are valid until the next call. A
  // picture that cannot be read comes with its `problem`.
  virtual std::optional<LiveFrame> next(std::chrono::nanoseconds timeout) = 0;
  // A recording's or a simulation's end; never a camera's.
  virtual bool ended() const { return false; }
  // The stamps are not of this moment but of the recording.
  virtual bool recorded() const { return false; }
  virtual LiveCounters counters() const = 0;
};

// CLOCK_MONOTONIC, ns.
int64_t camera_now_ns();

// Opens what `camera.source` names:
//   v4l2:DEVICE    a camera of the kernel's                gst:PIPELINE   a GStreamer pipeline, up to its raw
//   video video:FILE  images:GLOB  flight:FOLDER                 recordings, as open_image_source has them
// Throws ConfigError when the name or an option can never work (no such kind, a pipeline with a mistake), and
// std::runtime_error when a recording cannot be opened. A camera that is not there yet is waited for.
std::unique_ptr<LiveSource> open_live_source(const std::string& source, const LiveOptions& options = {},
                                             Channel channel = Channel::kGrey);

}  // namespace perch
