#include "perch/analysis/error_curves.h"

#include <algorithm>
#include <cmath>

#include "perch/analysis/statistics.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

// At most this many bins: more would leave too few frames in each for an RMS.
constexpr double kMostBins = 10;

// The shortest of 1, 2, 5, 10, ... (and their tenths) that covers `span` in at most kMostBins steps: edges at
// which a person would put them.
double bin_width(double span) {
  // A hovering flight's range hardly varies: one bin of a hundredth then.
  const double least = std::max(span / (kMostBins - 1), 0.01);
  const double decade = std::pow(10, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    // The tolerance forgives the rounding of pow and log10.
    if (factor * decade >= least * (1 - 1e-9)) return factor * decade;
  }
  return 10 * decade;
}

// All of the target, within the bin that ends there.
constexpr double kAll = 1 - 1e-9;

struct Errors {
  std::vector<double> position, rotation;
  std::vector<int64_t> second;  // of each position
};

ErrorBin bin_of(const Errors& errors, double from, double to) {
  const Statistics position = statistics(errors.position);
  const RmsInterval interval = rms_interval(errors.position, errors.second);
  return {.from = from,
          .to = to,
          .count = position.count,
          .position_rms = position.rms,
          .position_low = interval.low,
          .position_high = interval.high,
          .position_median = position.median,
          .rotation_rms = statistics(errors.rotation).rms};
}

// `scale`: bins have round edges in the value times this.
template <typename ValueOf>
ErrorCurve curve(std::string by, std::string unit, double scale, std::span<const FrameRecord> frames,
                 bool against_truth, ValueOf value_of) {
  ErrorCurve made{std::move(by), std::move(unit), {}};
  std::vector<const FrameRecord*> known;
  double least = INFINITY, most = -INFINITY;
  for (const FrameRecord& frame : frames) {
    const double value = scale * value_of(frame);
    if (!error_of(frame, against_truth) || !std::isfinite(value)) continue;
    known.push_back(&frame);
    least = std::min(least, value);
    most = std::max(most, value);
  }
  if (known.empty()) return made;
  const double width = bin_width(most - least);
  const double first = std::floor(least / width);
  const auto index = [&](double value) { return static_cast<size_t>(std::floor(value / width) - first); };
  std::vector<Errors> bins(index(most) + 1);
  for (const FrameRecord* frame : known) {
    Errors& errors = bins[index(scale * value_of(*frame))];
    errors.position.push_back(error_of(*frame, against_truth)->position);
    // Of a reference without an attitude there is none.
    const double rotation = error_of(*frame, against_truth)->rotation;
    if (std::isfinite(rotation)) errors.rotation.push_back(rotation);
    errors.second.push_back(frame->timestamp_ns / 1'000'000'000);
  }
  for (size_t i = 0; i < bins.size(); ++i) {
    const double from = (first + static_cast<double>(i)) * width;
    made.bins.push_back(bin_of(bins[i], from / scale, (from + width) / scale));
  }
  return made;
}

}  // namespace

std::vector<ErrorCurve> error_curves(std::span<const FrameRecord> frames, bool against_truth) {
  const auto of = [&](const char* by, const char* unit, double scale, double FrameRecord::*value) {
    return curve(by, unit, scale, frames, against_truth,
                 [value](const FrameRecord& frame) { return frame.*value; });
  };
  return {of("distance", "m", 1, &FrameRecord::range),
          of("view_angle", "rad", kDegFromRad, &FrameRecord::view_angle),
          curve("visible", "", 1, frames, against_truth,
                [](const FrameRecord& frame) {
                  return frame.look ? std::min(frame.look->visible, kAll)
                                    : std::numeric_limits<double>::quiet_NaN();
                }),
          of("speed", "m/s", 1, &FrameRecord::speed)};
}

}  // namespace perch
