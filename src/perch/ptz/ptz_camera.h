#pragma once

#include <cstdint>
#include <optional>

#include "perch/frames/frame_chain.h"
#include "perch/ptz/head_model.h"

namespace perch {

// Where a head is to go, or how it is to move.
struct HeadGoal {
  enum class Kind { kDrive, kAbsolute, kRelative };
  Kind kind = Kind::kDrive;
  double pan = 0, tilt = 0;  // rad; with kDrive rad/s
};

// A camera that pans, tilts and zooms, whatever the wire to it. No call waits for the device; times are
// CLOCK_MONOTONIC, ns. One thread at a time.
class PtzCamera {
 public:
  virtual ~PtzCamera() = default;

  // Takes the place of a goal that is still on its way.
  virtual void point(const HeadGoal& goal) = 0;
  // 0: widest, 1: narrowest.
  virtual void zoom_to(double zoom) = 0;

  // The head at a moment, with what is not sure of it; empty when it is not known.
  virtual std::optional<HeadAngles> at(int64_t time_ns) const = 0;
  // Where it should be, then or soon, if it does what it was told: to steer by, not to measure with.
  virtual std::optional<HeadAngles> expected_at(int64_t time_ns) const { return at(time_ns); }
  virtual std::optional<double> zoom() const = 0;
  // What the device can do, as far as it is known.
  virtual HeadModel model() const = 0;
  // It answers, and does what it is told.
  virtual bool ready() const = 0;
};

}  // namespace perch
