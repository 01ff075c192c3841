#include "perch/analysis/error_table.h"

#include <cstdarg>
#include <cstdio>

#include "perch/geometry/euler.h"

namespace perch {
namespace {

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char line[512];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(line, sizeof(line), pattern, arguments);
  va_end(arguments);
  return line;
}

std::string row(const std::string& name, const Statistics& s, double shown_per_si, const char* unit) {
  return format("  %-8s %9.3f %-3s  %+9.3f %-3s  %9.3f %-3s  %9.3f %s\n", name.c_str(), s.rms * shown_per_si,
                unit, s.mean * shown_per_si, unit, s.rms_without_mean * shown_per_si, unit,
                s.max * shown_per_si, unit);
}

// A length or an angle has no offset.
std::string size_row(const std::string& name, const Statistics& s, double shown_per_si, const char* unit) {
  return format("  %-8s %9.3f %-3s  %13s  %13s  %9.3f %s\n", name.c_str(), s.rms * shown_per_si, unit, "", "",
                s.max * shown_per_si, unit);
}

// Against navigation there is no verdict: its noise, mostly larger than vision's, is in the number.
std::string consistency_row(const Consistency& c) {
  if (c.nees.count == 0) return "";
  if (!c.by_truth)
    return format("  mean NEES %.2f, with navigation's noise counted as vision's\n", c.nees.mean);
  return format(
      "  the target in the camera's frame %.3f %% of the range; mean NEES %.2f, honest within %.2f to %.2f\n",
      100 * c.seen_over_range_rms, c.nees.mean, c.nees.lower, c.nees.upper);
}

}  // namespace

std::string error_table(const FlightScore& score) {
  constexpr double kCmFromM = 100;
  const Detections& detections = score.detections;
  std::string table = score.name + format(": %zu of %zu frames with a pose (%.1f %%)", detections.counts[0],
                                          detections.frames, 100 * detections.rate);
  if (score.comparison != Comparison::kCompared) {
    return table + "; nothing to compare with: " + to_string(score.comparison) + "\n";
  }
  table += format(", %zu compared with navigation\n", score.position.count);
  table += format("  %-8s %9s %-3s  %9s %-3s  %9s %-3s  %9s\n", "", "RMS", "", "DC offset", "", "without it",
                  "", "max");
  for (size_t i = 0; i < 6; ++i) {
    if (score.states[i].count == 0) continue;  // navigation tells no attitude
    table += row(std::string(kStateNames[i]), score.states[i], is_angle(i) ? kDegFromRad : kCmFromM,
                 is_angle(i) ? "deg" : "cm");
  }
  table += size_row("position", score.position, kCmFromM, "cm");
  if (score.rotation.count > 0) table += size_row("rotation", score.rotation, kDegFromRad, "deg");
  table += format("  position over range %.3f %%\n", 100 * score.relative_position_rms);
  if (score.truth) {
    table +=
        format("  against the flight's truth: position %.3f cm, %.3f %% of the range, rotation %.3f deg\n",
               score.truth->position.rms * kCmFromM, 100 * score.truth->relative_position_rms,
               score.truth->rotation.rms * kDegFromRad);
  }
  return table + consistency_row(score.consistency);
}

}  // namespace perch
