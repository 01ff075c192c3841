#pragma once

#include <limits>
#include <string>
#include <vector>

#include "perch/estimator/estimate.h"
#include "perch/flight/flight.h"
#include "perch/frames/frame_chain.h"

namespace perch {

// What one constant mistake of the calibration would explain of vision minus navigation.
struct ErrorCause {
  std::string
      cause;  // "mount rotation", "lever arm", "pad position", "pad rotation", "time offset", "lens scale"
  std::string unit;  // of the values: rad, m, s, or "" of the lens' scale
  // Of all causes fitted together: what the configuration lacks, the truth being the configured plus this (of
  // the lens: times 1 plus this). One number or three: mount rotation and lever arm in the axes of the body,
  // the pad's in its own.
  std::vector<double> value, sigma;
  // Of the squared errors, in units of what no cause explains: the part that goes when this cause alone is
  // fitted, and the part that comes back when it alone is left out. The two differ where causes resemble each
  // other.
  double alone = 0, only_by_this = 0;
};

struct Attribution {
  size_t count = 0;  // of frames that count; outliers do not. 0: too few to say
  double position_rms = std::numeric_limits<double>::quiet_NaN();    // vision minus navigation, m
  double rotation_rms = std::numeric_limits<double>::quiet_NaN();    // rad
  double position_noise = std::numeric_limits<double>::quiet_NaN();  // what no cause explains, m
  double rotation_noise = std::numeric_limits<double>::quiet_NaN();  // rad
  std::vector<ErrorCause> causes;  // the one that explains most alone comes first
};

// Least squares of the errors on what each cause does to them. Each is held by what can be wrong at all (10
// deg, 0.5 m, 0.2 s, 5 %), so that what the flight cannot tell apart stays near 0 and is shown with its
// deviation.
Attribution attribute_errors(const std::vector<Estimate>& estimates, const FrameChain& chain,
                             const Flight& flight);

}  // namespace perch
