#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "perch/analysis/attribution.h"
#include "perch/analysis/detections.h"
#include "perch/analysis/error_curves.h"
#include "perch/analysis/frame_record.h"
#include "perch/analysis/stage_costs.h"
#include "perch/analysis/statistics.h"
#include "perch/analysis/touch_down.h"
#include "perch/flight/flight.h"

namespace perch {

// What a run over one flight leaves, for `score_flight`.
struct FlightResult {
  Flight flight;                         // its name, navigation and problems
  FrameChain chain;                      // as the estimator ran with it
  std::vector<Estimate> estimates;       // one a frame, in the flight's order
  std::vector<std::string> frame_names;  // Frame::name, one an estimate; or none
  std::vector<GreyHistogram> greys;      // likewise
  std::vector<std::optional<TargetLook>> looks;
  std::vector<std::string> problems;  // the source's, besides those of `flight` and of the estimates
  std::string target;                 // "sharp, 1 m", for the report
  std::string camera;                 // "640x480 LENSMODEL_OPENCV4", likewise
};

// Errors squared, each normalised by the covariance that was claimed for it, of 6 degrees of freedom. The
// mean of N independent ones with an honest covariance is 6 and lies within the bounds 95 times of 100: 6 N
// chi-square degrees of freedom over N.
struct NormalisedErrors {
  size_t count = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  double lower = std::numeric_limits<double>::quiet_NaN(), upper = std::numeric_limits<double>::quiet_NaN();
  // Of single ones within the two-sided 95 % bounds below; 0.95 when honest.
  double fraction_inside = std::numeric_limits<double>::quiet_NaN();
};
inline constexpr double kChiSquareLower = 1.2373;   // 2.5 % of chi-square with 6 degrees of freedom
inline constexpr double kChiSquareUpper = 14.4494;  // 97.5 %

// How honest the covariances are.
struct Consistency {
  // Against the flight's exact truth where it holds one. Else against navigation, whose own noise then counts
  // as vision's: a mean NEES far above 6 says no more than that navigation is the noisier.
  bool by_truth = false;
  // RMS of the error of the target's position as the camera sees it, over range; of all frames with a
  // reference.
  double seen_over_range_rms = std::numeric_limits<double>::quiet_NaN();
  NormalisedErrors nees;  // of vision against the reference
  NormalisedErrors nis;   // of vision against what the filter expected: needs no reference
};

// Why there are errors, or none.
enum class Comparison { kCompared, kNoNavigation, kNoWorldFromPad, kNoCommonTime, kNotEstimated };
const char* to_string(Comparison comparison);

// The errors against the flight's exact truth, of a flight that has navigation too.
struct TruthScore {
  Statistics position;  // of the distances, m
  Statistics rotation;  // of the angles between the attitudes, rad
  double relative_position_rms = std::numeric_limits<double>::quiet_NaN();  // of position error over range
};

// What a flight was like: medians of its frames. What nobody knows is NaN.
struct Conditions {
  double rate_hz = std::numeric_limits<double>::quiet_NaN();
  double range = std::numeric_limits<double>::quiet_NaN();       // m
  double view_angle = std::numeric_limits<double>::quiet_NaN();  // rad
  double speed = std::numeric_limits<double>::quiet_NaN();       // m/s
  double white = std::numeric_limits<double>::quiet_NaN();       // of the target, grey level
  double visible = std::numeric_limits<double>::quiet_NaN();     // part of the target
};

struct FlightScore {
  std::string name, target, camera;
  Conditions conditions;
  std::vector<FrameRecord> frames;
  std::vector<std::string> frame_names;
  std::vector<std::string> problems;

  Comparison comparison = Comparison::kNoNavigation;
  std::array<Statistics, 6> states;  // of SixStates, vision minus navigation: m, rad
  Statistics position;               // of the distances, m
  Statistics rotation;               // of the angles between the attitudes, rad
  double relative_position_rms = std::numeric_limits<double>::quiet_NaN();  // of position error over range
  std::vector<ErrorCurve> curves;  // against the truth where the flight has it, else against navigation
  std::optional<TouchDown> touch_down;
  std::optional<TruthScore> truth;
  Consistency consistency;
  Attribution attribution;

  Statistics reprojection_px;
  Detections detections;
  StageCosts costs;
};

// Scores a flight. No frame, no navigation, no detection: all are flights, with statistics of nothing.
FlightScore score_flight(const FlightResult& result);

// What a run's summary and report say of a flight that could not be estimated at all.
FlightScore failed_flight(const std::string& name, const std::string& problem);

// A frame worth a picture in the report, and why.
struct ShownFrame {
  size_t frame = 0;  // index into the flight's frames
  std::string why;   // "best", "median", "worst", "longest gap"
};

// By position error where navigation says it, else by reprojection error; the worst last, then the middle of
// the longest gap whose picture can be read. No frame twice.
std::vector<ShownFrame> frames_to_show(const FlightScore& score);

}  // namespace perch
