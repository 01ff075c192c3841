#include "perch/flight/head_angles.h"

#include <algorithm>

namespace perch {
namespace {

constexpr int64_t kMaxAgeNs = 100'000'000;

}  // namespace

std::optional<HeadAngles> head_angles_at(std::span<const GimbalSample> samples, int64_t camera_time_ns) {
  const auto after = std::lower_bound(samples.begin(), samples.end(), camera_time_ns,
                                      [](const GimbalSample& s, int64_t t) { return s.timestamp_ns < t; });
  const auto near = [&](const GimbalSample& s) -> std::optional<HeadAngles> {
    if (std::abs(s.timestamp_ns - camera_time_ns) > kMaxAgeNs) return std::nullopt;
    return HeadAngles{s.pan, s.tilt};
  };
  if (samples.empty()) return std::nullopt;
  if (after == samples.begin()) return near(*after);
  if (after == samples.end()) return near(samples.back());
  const GimbalSample& a = *(after - 1);
  const GimbalSample& b = *after;
  if (b.timestamp_ns - a.timestamp_ns > 2 * kMaxAgeNs) {
    return near(camera_time_ns - a.timestamp_ns < b.timestamp_ns - camera_time_ns ? a : b);
  }
  const double s = static_cast<double>(camera_time_ns - a.timestamp_ns) /
                   static_cast<double>(b.timestamp_ns - a.timestamp_ns);
  return HeadAngles{(1 - s) * a.pan + s * b.pan, (1 - s) * a.tilt + s * b.tilt};
}

}  // namespace perch
