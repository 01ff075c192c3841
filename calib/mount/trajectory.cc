#include "calib/mount/trajectory.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

double seconds(int64_t ns) { return 1e-9 * static_cast<double>(ns); }

}  // namespace

double usual_half_window(const NavTrack& nav) {
  std::vector<int64_t> steps;
  for (size_t i = 1; i < nav.samples.size(); ++i) {
    steps.push_back(nav.samples[i].timestamp_ns - nav.samples[i - 1].timestamp_ns);
  }
  if (steps.empty()) return 0;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  const double step = seconds(steps[steps.size() / 2]);
  // A multirotor's attitude swings at 1 Hz and little faster: a quadratic over 0.2 s is then off by 1 % of 1
  // deg.
  return step > 0.2 ? 0 : std::max(0.1, 2.5 * step);
}

Trajectory::Trajectory(NavTrack nav, double half_window) : nav_(std::move(nav)), half_window_(half_window) {
  if (smooth()) measure_noise();
}

std::optional<TrajectoryPoint> Trajectory::at(int64_t navigation_ns) const {
  if (smooth()) {
    if (auto fitted = fit(navigation_ns)) return fitted->point;
    return std::nullopt;
  }
  return join(navigation_ns);
}

std::optional<TrajectoryPoint> Trajectory::join(int64_t ns) const {
  const auto& samples = nav_.samples;
  const auto after = std::lower_bound(samples.begin(), samples.end(), ns,
                                      [](const NavSample& s, int64_t t) { return s.timestamp_ns < t; });
  if (after == samples.end()) return std::nullopt;
  const bool exact = after->timestamp_ns == ns;
  if (after == samples.begin()) {
    if (exact) return TrajectoryPoint{after->world_from_body};
    return std::nullopt;
  }
  const NavSample& a = *std::prev(after);
  const double gap = seconds(after->timestamp_ns - a.timestamp_ns);
  if (gap > NavTrack::kMaxGap) {
    if (exact) return TrajectoryPoint{after->world_from_body};
    return std::nullopt;
  }
  const double s = seconds(ns - a.timestamp_ns) / gap;
  TrajectoryPoint point;
  point.world_from_body = interpolate(a.world_from_body, after->world_from_body, s);
  point.velocity = (after->world_from_body.translation - a.world_from_body.translation) / gap;
  point.turn_rate = so3_log(after->world_from_body.rotation * a.world_from_body.rotation.conjugate()) / gap;
  point.noise_part = (1 - s) * (1 - s) + s * s;
  return point;
}

std::optional<Trajectory::Fit> Trajectory::fit(int64_t ns) const {
  const auto& samples = nav_.samples;
  const auto reach = std::llround(1e9 * half_window_);
  const auto first = std::lower_bound(samples.begin(), samples.end(), ns - reach,
                                      [](const NavSample& s, int64_t t) { return s.timestamp_ns < t; });
  const auto middle = std::lower_bound(first, samples.end(), ns,
                                       [](const NavSample& s, int64_t t) { return s.timestamp_ns < t; });
  // Inside of the flight, and of no gap.
  if (middle == samples.end() || (middle == samples.begin() && middle->timestamp_ns != ns))
    return std::nullopt;
  const int64_t gap = std::llround(1e9 * std::max(NavTrack::kMaxGap, 0.0));
  if (middle != samples.begin() && middle->timestamp_ns - std::prev(middle)->timestamp_ns > gap) {
    return std::nullopt;
  }
  const Eigen::Quaterniond reference = middle->world_from_body.rotation;
  const Eigen::Vector3d origin = middle->world_from_body.translation;
  Eigen::Matrix3d XWX = Eigen::Matrix3d::Zero(), XWWX = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 6> XWy = Eigen::Matrix<double, 3, 6>::Zero();
  int count = 0;
  for (auto it = first; it != samples.end() && it->timestamp_ns <= ns + reach; ++it) {
    const double u = seconds(it->timestamp_ns - ns) / half_window_;  // -1 .. 1
    const double w = 1 - u * u;
    if (!(w > 0)) continue;
    ++count;
    const Eigen::Vector3d x(1, u, u * u);
    Eigen::Matrix<double, 1, 6> y;
    y << (it->world_from_body.translation - origin).transpose(),
        so3_log(it->world_from_body.rotation * reference.conjugate()).transpose();
    XWX += w * x * x.transpose();
    XWWX += w * w * x * x.transpose();
    XWy += w * x * y;
  }
  // Three samples are met exactly; with fewer there is no quadratic.
  if (count < 4 || !(XWX.determinant() > 1e-9 * std::pow(count, 3))) {
    if (auto joined = join(ns)) return Fit{*joined, 1};
    return std::nullopt;
  }
  const Eigen::Matrix3d inverse_XWX = XWX.inverse();
  const Eigen::Matrix<double, 3, 6> c = inverse_XWX * XWy;
  Fit result;
  const Eigen::Vector3d turn = c.row(0).tail<3>();
  result.point.world_from_body = {(so3_exp(turn) * reference).normalized(),
                                  origin + c.row(0).head<3>().transpose()};
  result.point.velocity = c.row(1).head<3>() / half_window_;
  result.point.turn_rate = so3_left_jacobian(turn) * c.row(1).tail<3>().transpose() / half_window_;
  result.point.noise_part = (inverse_XWX * XWWX * inverse_XWX)(0, 0);
  result.leverage = inverse_XWX(0, 0);
  return result;
}

void Trajectory::measure_noise() {
  double position = 0, rotation = 0, freedom = 0;
  for (const NavSample& sample : nav_.samples) {
    const auto fitted = fit(sample.timestamp_ns);
    if (!fitted || fitted->leverage >= 0.999) continue;
    const PoseError off = pose_error(fitted->point.world_from_body, sample.world_from_body);
    position += off.head<3>().squaredNorm();
    rotation += off.tail<3>().squaredNorm();
    // Variance of y - fit: one sample's, less twice its own part in the fit, plus the fit's.
    freedom += 3 * (1 - 2 * fitted->leverage + fitted->point.noise_part);
  }
  if (freedom <= 0) return;
  position_noise_ = std::sqrt(position / freedom);
  rotation_noise_ = std::sqrt(rotation / freedom);
}

}  // namespace perch
