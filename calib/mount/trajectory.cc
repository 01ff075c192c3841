#include "calib/mount/trajectory.h"

#include <cmath>
#include <utility>
#include <vector>

namespace perch {
namespace {

// Counted from the first sample, so that a double holds them to less than a picosecond.
double seconds(const NavTrack& nav, int64_t ns) {
  return 1e-9 * static_cast<double>(ns - nav.samples.front().timestamp_ns);
}

std::vector<double> times(const NavTrack& nav) {
  std::vector<double> times;
  for (const NavSample& s : nav.samples) times.push_back(seconds(nav, s.timestamp_ns));
  return times;
}

// From the first one: positions in the world may be large.
SmoothingSpline position_spline(const NavTrack& nav) {
  std::vector<Eigen::Vector4d> positions;
  for (const NavSample& s : nav.samples) {
    positions.emplace_back();
    positions.back() << s.world_from_body.translation - nav.samples[0].world_from_body.translation, 0;
  }
  return {times(nav), positions, NavTrack::kMaxGap};
}

SmoothingSpline rotation_spline(const NavTrack& nav) {
  std::vector<Eigen::Vector4d> quaternions;
  for (const NavSample& s : nav.samples) {
    Eigen::Vector4d q = s.world_from_body.rotation.coeffs();
    if (!quaternions.empty() && q.dot(quaternions.back()) < 0) q = -q;
    quaternions.push_back(q);
  }
  return {times(nav), quaternions, NavTrack::kMaxGap};
}

// Two samples almost at once tell of a rate what their noise makes of it, and nothing else; and the spline's
// stiffness grows with the fifth power of their distance: less than a third of the usual step apart, the
// first stands.
NavTrack well_apart(NavTrack nav) {
  if (nav.samples.empty()) return nav;
  const int64_t least = std::llround(1e9 / 3 * median_step(times(nav)));
  int64_t last = nav.samples.front().timestamp_ns - least - 1;
  std::erase_if(nav.samples, [&](const NavSample& sample) {
    if (sample.timestamp_ns - last < least) return true;
    last = sample.timestamp_ns;
    return false;
  });
  return nav;
}

}  // namespace

Trajectory::Trajectory(NavTrack nav)
    : nav_(well_apart(std::move(nav))), position_(position_spline(nav_)), rotation_(rotation_spline(nav_)) {}

std::optional<TrajectoryPoint> Trajectory::at(int64_t navigation_ns) const {
  if (nav_.samples.empty()) return std::nullopt;
  const double t = seconds(nav_, navigation_ns);
  const auto p = position_.at(t), q = rotation_.at(t);
  if (!p || !q) return std::nullopt;
  TrajectoryPoint point;
  const Eigen::Quaterniond rotation(q->value), rate(q->rate);
  point.world_from_body = {rotation.normalized(),
                           nav_.samples[0].world_from_body.translation + p->value.head<3>()};
  point.velocity = p->rate.head<3>();
  point.turn_rate = 2 * (rate * rotation.conjugate()).vec() / q->value.squaredNorm();
  point.noise_part << Eigen::Vector3d::Constant(p->variance_part),
      Eigen::Vector3d::Constant(q->variance_part);
  return point;
}

}  // namespace perch
