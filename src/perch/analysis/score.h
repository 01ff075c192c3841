#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "perch/analysis/attribution.h"
#include "perch/analysis/detections.h"
#include "perch/analysis/frame_record.h"
#include "perch/analysis/stage_costs.h"
#include "perch/analysis/statistics.h"
#include "perch/flight/flight.h"

namespace perch {

// What a run over one flight leaves, for `score_flight`.
struct FlightResult {
  Flight flight;                         // its name, navigation and problems
  FrameChain chain;                      // as the estimator ran with it
  std::vector<Estimate> estimates;       // one a frame, in the flight's order
  std::vector<std::string> frame_names;  // Frame::name, one an estimate; or none
  std::vector<std::string> problems;     // the source's, besides those of `flight` and of the estimates
  std::string target;                    // "sharp, 1 m", for the report
};

// Errors at like distances.
struct DistanceBin {
  double from = 0, to = 0;  // range, m; from <= range < to
  size_t count = 0;
  // NaN of an empty bin.
  double position_rms = 0, position_median = 0;  // m
  double rotation_rms = 0;                       // rad
};

// How honest vision's covariance is. The mean NEES of N independent frames with an honest covariance is 6 and
// lies within the bounds 95 times of 100: 6 N chi-square degrees of freedom over N.
struct Consistency {
  // Against the flight's exact truth where it holds one. Else against navigation, whose own noise then counts
  // as vision's: a mean NEES far above 6 says no more than that navigation is the noisier.
  bool by_truth = false;
  // RMS of the error of the target's position as the camera sees it, over range; of all frames with a
  // reference.
  double seen_over_range_rms = std::numeric_limits<double>::quiet_NaN();
  size_t count = 0;
  double mean_nees = std::numeric_limits<double>::quiet_NaN();
  double lower = std::numeric_limits<double>::quiet_NaN(), upper = std::numeric_limits<double>::quiet_NaN();
  // Of single frames within the two-sided 95 % bounds below; 0.95 when honest.
  double fraction_inside = std::numeric_limits<double>::quiet_NaN();
};
inline constexpr double kNeesLower = 1.2373;   // 2.5 % of chi-square with 6 degrees of freedom
inline constexpr double kNeesUpper = 14.4494;  // 97.5 %

// Why there are errors, or none.
enum class Comparison { kCompared, kNoNavigation, kNoWorldFromPad, kNoCommonTime, kNotEstimated };
const char* to_string(Comparison comparison);

// The errors against the flight's exact truth, of a flight that has navigation too.
struct TruthScore {
  Statistics position;  // of the distances, m
  Statistics rotation;  // of the angles between the attitudes, rad
  double relative_position_rms = std::numeric_limits<double>::quiet_NaN();  // of position error over range
};

struct FlightScore {
  std::string name, target;
  std::vector<FrameRecord> frames;
  std::vector<std::string> frame_names;
  std::vector<std::string> problems;

  Comparison comparison = Comparison::kNoNavigation;
  std::array<Statistics, 6> states;  // of SixStates, vision minus navigation: m, rad
  Statistics position;               // of the distances, m
  Statistics rotation;               // of the angles between the attitudes, rad
  double relative_position_rms = std::numeric_limits<double>::quiet_NaN();  // of position error over range
  std::vector<DistanceBin> bins;
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
