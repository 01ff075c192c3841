#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "perch/analysis/frame_record.h"

namespace perch {

// Errors of frames that are alike in one way.
struct ErrorBin {
  double from = 0, to = 0;  // from <= value < to
  size_t count = 0;
  // NaN of an empty bin; the 95 % interval of the RMS also where the frames are of fewer than three seconds.
  double position_rms = std::numeric_limits<double>::quiet_NaN();  // m
  double position_low = std::numeric_limits<double>::quiet_NaN();
  double position_high = std::numeric_limits<double>::quiet_NaN();
  double position_median = std::numeric_limits<double>::quiet_NaN();
  double rotation_rms = std::numeric_limits<double>::quiet_NaN();  // rad
};

// How the errors depend on something.
struct ErrorCurve {
  std::string by;    // "distance", "view_angle", "visible" or "speed"
  std::string unit;  // "m", "rad", "", "m/s"
  std::vector<ErrorBin> bins;
};

// All four, in this order: without bins where no frame knows both its error and the value.
//   distance    camera to the target's origin
//   view_angle  between the line of sight to it and its normal
//   visible     TargetLook::visible
//   speed       of the body in the world, as navigation says
std::vector<ErrorCurve> error_curves(std::span<const FrameRecord> frames, bool against_truth);

}  // namespace perch
