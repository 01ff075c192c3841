#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/camera/calibration.h"
#include "calib/camera/landing_error.h"
#include "calib/camera/row_shear.h"

namespace perch {

// What is asked of a calibration: `--require`'s thresholds. Those that are not set are not asked.
struct Requirements {
  std::optional<double> max_uncertainty_px;  // at infinity, worst direction, on 95 % of the covered picture
  std::optional<double> max_corner_px;       // the same, anywhere in the picture
  std::optional<double> max_halves_ratio;    // difference of the halves over its prediction
  std::optional<double> max_sigma_px;        // the corners' noise
  std::optional<double> max_outliers;        // as a part of all corners
  std::optional<double> min_coverage;        // part of the picture in which boards have been
  std::optional<double> max_landing_m;       // mean landing error at the farthest of the ranges asked for
};

// Those that docs/CALIBRATE_CAMERA.md recommends, with their reasons there.
Requirements recommended_requirements();

// "uncertainty_px=0.5,coverage=0.8" or "recommended". Throws CalibrationError naming what it cannot read.
Requirements parse_requirements(const std::string& text);

// One requirement held against the calibration.
struct Gate {
  std::string key;   // as in --require
  std::string what;  // in words
  double found = 0;  // NaN: could not be found out, which meets nothing
  double limit = 0;
  bool at_least = false;
  bool met = false;
};

// A picture that the lens does not fit as it fits the others.
struct SuspectView {
  size_t view = 0;
  double rms_px = 0;    // of all its corners, outliers too
  double outliers = 0;  // part of its corners
  std::string why;
};

struct Verdict {
  double uncertainty_px = 0;  // 95 % of the covered picture, at infinity
  double corner_px = 0;       // most anywhere in the picture
  double coverage = 0;        // part of the picture
  double halves_ratio = 0;    // NaN without cross-validation
  double outliers = 0;        // part
  int leaning_regions = 0;    // of 16 parts of the picture, in which the errors lean one way
  RowShear row_shear;
  std::vector<LandingError> landing;
  std::vector<std::string> missing;
  std::vector<std::string> warnings;  // what in the errors does not look as it should
  std::vector<SuspectView> suspects;  // worst first
  std::vector<Gate> gates;            // the recommended ones and those required
  std::string summary;                // two or three sentences for a person
};

Verdict judge(const BoardViews& views, const Calibration& calibration, const LandingTarget& target);

// All requirements that are set; the work has failed when one of them is not met.
std::vector<Gate> check(const Verdict& verdict, const Calibration& calibration,
                        const Requirements& requirements);

// "uncertainty at infinity on 95 % of the picture where boards have been: 0.71 px, asked for at most 0.5"
std::string in_words(const Gate& gate);

}  // namespace perch
