#pragma once

#include <memory>
#include <string>

#include "perch/camera/live_clock.h"
#include "perch/camera/live_source.h"

namespace perch {

// What a device has to say when it is asked for a picture.
struct Grab {
  bool picture = false;
  int64_t lost = 0;       // pictures that there were since the last one and that nobody will see
  std::string problem;    // worth telling, and no reason to open the device anew
  bool settling = false;  // the stamp is not to be relied upon yet
};

// A camera as LiveCamera drives it: opened, asked for pictures until something is wrong, closed, opened
// again. Messages begin with the device's name.
class CameraDevice {
 public:
  virtual ~CameraDevice() = default;
  // Throws std::runtime_error when it cannot be opened; it is closed then.
  virtual void open() = 0;
  virtual void close() = 0;
  // Waits `timeout_ns` at most for the newest picture; its stamp is the middle of the exposure on
  // CLOCK_MONOTONIC as far as the device knows. Throws std::runtime_error when the device broke.
  virtual Grab grab(Frame& frame, int64_t timeout_ns) = 0;
  virtual std::string name() const = 0;
};

// The live source of a device: survives whatever it does.
//
//            open() works                no picture for too long, or grab() throws
//   closed ───────────────▶ open   open ──────────────────────────────────────────▶ closed
//   closed: tried again after 0.1 s, twice as long after each failure up to 5 s; a picture sets that back.
//
// Takes options.latency off the stamps, keeps back pictures while the device's stamps settle, and drops
// pictures whose stamp cannot be true: not after the last one's, in the future, or older than any camera
// keeps a picture.
std::unique_ptr<LiveSource> make_live_camera(std::unique_ptr<CameraDevice> device, const LiveOptions& options,
                                             LiveClock& clock = monotonic_clock());

}  // namespace perch
