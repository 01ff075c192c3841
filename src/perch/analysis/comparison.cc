#include "perch/analysis/comparison.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "perch/analysis/statistics.h"

namespace perch {
namespace {

constexpr size_t kDraws = 2000;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double found(const ComparedFrames& s) {
  if (s.frames == 0) return kNone;
  return 100 * (static_cast<double>(s.ok[1]) - static_cast<double>(s.ok[0])) / static_cast<double>(s.frames);
}

double percent_of(double was, double is) { return was > 0 ? 100 * (is / was - 1) : is > 0 ? kNone : 0; }
double rms_change(const std::array<double, 2>& squares) {
  return percent_of(std::sqrt(squares[0]), std::sqrt(squares[1]));
}

struct Quantity {
  const char* name;  // before the number, as the others are after it
  const char *less, *more, *unchanged;
  double tolerance;
  bool more_is_better, counts;
  double (*change)(const ComparedFrames&);
};

const std::array<Quantity, 5> kQuantities{{
    {"B finds", "fewer frames", "more frames", "B finds as many frames", kFoundTolerancePercent, true, true,
     found},
    {"position RMS", "lower", "higher", "position RMS unchanged", kErrorTolerancePercent, false, true,
     [](const ComparedFrames& s) { return s.both ? rms_change(s.position) : kNone; }},
    {"position RMS over distance", "lower", "higher", "position RMS over distance unchanged",
     kErrorTolerancePercent, false, true,
     [](const ComparedFrames& s) { return s.both ? rms_change(s.over_range) : kNone; }},
    {"attitude RMS", "lower", "higher", "attitude RMS unchanged", kErrorTolerancePercent, false, true,
     [](const ComparedFrames& s) { return s.both ? rms_change(s.angles) : kNone; }},
    {"time a frame", "less", "more", "time a frame unchanged", kErrorTolerancePercent, false, false,
     [](const ComparedFrames& s) { return s.us[0] > 0 ? percent_of(s.us[0], s.us[1]) : kNone; }},
}};

// The sums of as many samples as there are, drawn with replacement, again and again.
std::vector<ComparedFrames> draw(std::span<const ComparedFrames> samples) {
  std::mt19937_64 generator(20260101);  // any, but always the same
  std::vector<ComparedFrames> sums(kDraws);
  for (ComparedFrames& sum : sums) {
    // std::uniform_int_distribution is another one with every library.
    for (size_t i = 0; i < samples.size(); ++i) sum += samples[generator() % samples.size()];
  }
  return sums;
}

Verdict judge(const Interval& percent, const Quantity& quantity) {
  const double t = quantity.tolerance;
  if (-t <= percent.low && percent.high <= t) return Verdict::kUnchanged;
  if ((percent.low <= 0 && percent.high >= 0) || std::abs(percent.value) <= t) return Verdict::kUnclear;
  return (percent.value > 0) == quantity.more_is_better ? Verdict::kBetter : Verdict::kWorse;
}

std::string say(const Quantity& quantity, const Change& change) {
  const Interval& p = change.percent;
  char text[200];
  if (change.verdict == Verdict::kUnchanged) {
    std::snprintf(text, sizeof(text), "%s within %g %% [%+.2f, %+.2f]", quantity.unchanged,
                  quantity.tolerance, p.low, p.high);
    return text;
  }
  // Size and bounds of what is said: "fewer by 1.2 [0.9, 1.5]".
  const double sign = p.value < 0 ? -1 : 1;
  const double low = std::min(sign * p.low, sign * p.high), high = std::max(sign * p.low, sign * p.high);
  const char* direction = p.value < 0 ? quantity.less : quantity.more;
  std::snprintf(text, sizeof(text), "%s %.2f %% %s [%.2f, %.2f]", quantity.name, sign * p.value, direction,
                low, high);
  return text + std::string(change.verdict == Verdict::kUnclear ? ", which may be chance" : "");
}

}  // namespace

ComparedFrames& ComparedFrames::operator+=(const ComparedFrames& other) {
  frames += other.frames;
  both += other.both;
  for (size_t i = 0; i < 2; ++i) {
    ok[i] += other.ok[i];
    us[i] += other.us[i];
    position[i] += other.position[i];
    over_range[i] += other.over_range[i];
    angles[i] += other.angles[i];
  }
  return *this;
}

std::vector<Change> changes_of(std::span<const ComparedFrames> samples) {
  if (samples.empty()) return {};
  ComparedFrames all;
  for (const ComparedFrames& sample : samples) all += sample;
  const std::vector<ComparedFrames> sums = draw(samples);
  std::vector<Change> changes;
  for (const Quantity& quantity : kQuantities) {
    Change change;
    change.counts = quantity.counts;
    change.percent.value = quantity.change(all);
    if (!std::isfinite(change.percent.value)) continue;
    std::vector<double> drawn;
    for (const ComparedFrames& sum : sums) {
      // A draw of flights without any error to compare says nothing.
      if (const double value = quantity.change(sum); std::isfinite(value)) drawn.push_back(value);
    }
    if (drawn.empty()) continue;
    change.percent.low = quantile(drawn, 0.025);
    change.percent.high = quantile(drawn, 0.975);
    // One sample, drawn again and again, shows no spread.
    change.verdict = samples.size() < 2 ? Verdict::kUnclear : judge(change.percent, quantity);
    change.sentence = say(quantity, change);
    changes.push_back(change);
  }
  return changes;
}

}  // namespace perch
