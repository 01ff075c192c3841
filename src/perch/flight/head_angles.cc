#include "perch/flight/head_angles.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

constexpr int64_t kMaxAgeNs = 100'000'000;

}  // namespace

std::optional<GimbalSample> gimbal_at(std::span<const GimbalSample> samples, int64_t camera_time_ns) {
  const auto after = std::lower_bound(samples.begin(), samples.end(), camera_time_ns,
                                      [](const GimbalSample& s, int64_t t) { return s.timestamp_ns < t; });
  const auto near = [&](const GimbalSample& s) -> std::optional<GimbalSample> {
    if (std::abs(s.timestamp_ns - camera_time_ns) > kMaxAgeNs) return std::nullopt;
    return s;
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
  const auto between = [s](double from, double to) { return (1 - s) * from + s * to; };
  GimbalSample sample{camera_time_ns, between(a.pan, b.pan), between(a.tilt, b.tilt), {}};
  if (a.zoom && b.zoom) sample.zoom = std::lerp(*a.zoom, *b.zoom, s);  // exact where both are one
  return sample;
}

std::optional<HeadAngles> head_angles_at(std::span<const GimbalSample> samples, int64_t camera_time_ns) {
  const auto sample = gimbal_at(samples, camera_time_ns);
  if (!sample) return std::nullopt;
  return HeadAngles{sample->pan, sample->tilt};
}

}  // namespace perch
