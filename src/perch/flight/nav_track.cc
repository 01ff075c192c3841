#include "perch/flight/nav_track.h"

#include <algorithm>

namespace perch {

namespace {

// later - earlier, s; the difference of any two int64 fits a uint64.
double seconds(int64_t earlier, int64_t later) {
  return static_cast<double>(static_cast<uint64_t>(later) - static_cast<uint64_t>(earlier)) * 1e-9;
}

NavSample extrapolated(const NavSample& end, int64_t timestamp_ns, double dt) {
  NavSample sample = end;
  sample.timestamp_ns = timestamp_ns;
  sample.world_from_body.translation += dt * end.body_velocity_in_world;
  return sample;
}

// No UAV that lands accelerates faster, m/s^2: a velocity that the positions contradict (in body axes, in
// knots, left at zero) is not used.
constexpr double kMaxAcceleration = 30;

// Whether both velocities fit the way between the samples: at acceleration a they differ from its mean by a T
// / 2.
bool velocities_fit(const NavSample& a, const NavSample& b, double gap) {
  const Eigen::Vector3d mean = (b.world_from_body.translation - a.world_from_body.translation) / gap;
  const double limit = kMaxAcceleration * gap / 2;
  return (a.body_velocity_in_world - mean).norm() <= limit &&
         (b.body_velocity_in_world - mean).norm() <= limit;
}

// The cubic through both positions with both velocities (Hermite): exact for a constant jerk, where the
// straight line is off by 6 cm at 2 m/s^2 and a gap of 0.5 s.
Eigen::Vector3d cubic(const NavSample& a, const NavSample& b, double s, double gap) {
  const double t = 1 - s;
  return t * t * (1 + 2 * s) * a.world_from_body.translation +
         s * s * (1 + 2 * t) * b.world_from_body.translation +
         s * t * gap * (t * a.body_velocity_in_world - s * b.body_velocity_in_world);
}

}  // namespace

std::optional<NavSample> NavTrack::at(int64_t timestamp_ns, double ahead) const {
  const auto after = std::lower_bound(samples.begin(), samples.end(), timestamp_ns,
                                      [](const NavSample& s, int64_t time) { return s.timestamp_ns < time; });
  if (after != samples.end() && after->timestamp_ns == timestamp_ns) return *after;
  if (samples.empty()) return std::nullopt;
  if (after == samples.begin()) {
    const double dt = seconds(timestamp_ns, after->timestamp_ns);
    if (dt > ahead) return std::nullopt;
    return extrapolated(*after, timestamp_ns, -dt);
  }
  const NavSample& a = *std::prev(after);
  if (after == samples.end()) {
    const double dt = seconds(a.timestamp_ns, timestamp_ns);
    if (dt > ahead) return std::nullopt;
    return extrapolated(a, timestamp_ns, dt);
  }
  const NavSample& b = *after;
  const double gap = seconds(a.timestamp_ns, b.timestamp_ns);
  if (gap > kMaxGap) return std::nullopt;
  const double s = seconds(a.timestamp_ns, timestamp_ns) / gap;
  NavSample sample{timestamp_ns, interpolate(a.world_from_body, b.world_from_body, s),
                   (1 - s) * a.body_velocity_in_world + s * b.body_velocity_in_world};
  if (velocities_fit(a, b, gap)) sample.world_from_body.translation = cubic(a, b, s, gap);
  return sample;
}

}  // namespace perch
