#include "perch/ptz/head_control.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "perch/geometry/so3.h"
#include "perch/ptz/pointing.h"

namespace perch {
namespace {

double seconds(int64_t ns) { return static_cast<double>(ns) * 1e-9; }
int64_t nanoseconds(double s) { return std::llround(s * 1e9); }

// Over which the goal's speed is taken.
constexpr double kStep = 0.02;  // s
// A velocity is not taken further than that: what was seen 2 s ago may have turned round.
constexpr double kMostCarried = 2;  // s
// After a turn of the target's motion the head is on its way by then: picture, lag, and one over the gain.
constexpr double kFollows = 0.35;  // s

const Rigid3& zero_of(const FrameChain& chain) {
  if (!chain.pan_tilt) throw std::invalid_argument("frames.base_from_camera: expected pan_tilt");
  return chain.pan_tilt->base_from_zero;
}

Eigen::Vector3d middle_ray(const CameraModel& camera) {
  const auto ray = camera.ray_from_pixel({(camera.width() - 1) / 2.0, (camera.height() - 1) / 2.0});
  return ray.value_or(Eigen::Vector3d::UnitZ());
}

double smaller_view(const CameraModel& camera) {
  const double x = (camera.width() - 1) / 2.0, y = (camera.height() - 1) / 2.0;
  const bool wide = camera.width() >= camera.height();
  const auto low = camera.ray_from_pixel(wide ? Eigen::Vector2d(x, 0) : Eigen::Vector2d(0, y));
  const auto high = camera.ray_from_pixel(wide ? Eigen::Vector2d(x, 2 * y) : Eigen::Vector2d(2 * x, y));
  if (!low || !high) return 0.5;
  return std::acos(std::clamp(low->dot(*high), -1.0, 1.0));
}

}  // namespace

HeadControl::HeadControl(const FrameChain& chain, const CameraModel& camera, const HeadModel& model,
                         const HeadControlOptions& options)
    : chain_(chain),
      zero_from_body_(inverse(chain.body_from_base.value_or(Rigid3{}) * zero_of(chain))),
      middle_ray_(middle_ray(camera)),
      widest_(smaller_view(camera)),
      view_(widest_),
      model_(model),
      options_(options),
      search_(model, widest_) {}

void HeadControl::look_through(const CameraModel& camera) {
  middle_ray_ = middle_ray(camera);
  view_ = smaller_view(camera);
}

std::optional<HeadAngles> HeadControl::centring(const Eigen::Vector3d& target_in_body) const {
  const Eigen::Vector3d target_in_zero = zero_from_body_ * target_in_body;
  if (!(target_in_zero.norm() > 0)) return std::nullopt;
  const auto angles = angles_to_see_at(target_in_zero, middle_ray_);
  if (!angles) return std::nullopt;
  return HeadAngles{std::clamp(angles->pan, model_.pan.min, model_.pan.max),
                    std::clamp(angles->tilt, model_.tilt.min, model_.tilt.max)};
}

std::optional<HeadAngles> HeadControl::centring(const VehicleState& state, int64_t time_ns) const {
  const double dt = seconds(time_ns - state.timestamp_ns);
  Rigid3 pad_from_body = state.pad_from_body;
  pad_from_body.translation += dt * state.body_velocity_in_pad;
  pad_from_body.rotation = so3_exp(dt * state.body_angular_velocity_in_pad) * pad_from_body.rotation;
  const Eigen::Vector3d target_in_pad = inverse(chain_.target_from_pad).translation;
  return centring(inverse(pad_from_body) * target_in_pad);
}

std::optional<HeadControl::Sight> HeadControl::sight(const VehicleState& state, int64_t now_ns,
                                                     const PtzCamera& head) const {
  const auto angles = head.expected_at(now_ns);
  const auto goal = centring(state, now_ns), soon = centring(state, now_ns + nanoseconds(kStep));
  if (!angles || !goal || !soon) return std::nullopt;
  const Eigen::Vector3d target_in_pad = inverse(chain_.target_from_pad).translation;
  const Eigen::Vector3d away = state.pad_from_body.translation - target_in_pad;
  if (!(away.norm() > 0)) return std::nullopt;
  Sight sight;
  sight.distance = (zero_from_body_ * (inverse(state.pad_from_body) * target_in_pad)).norm();
  sight.closing = -state.body_velocity_in_pad.dot(away) / away.norm();
  const double rate = std::hypot(soon->pan - goal->pan, soon->tilt - goal->tilt) / kStep;
  sight.aside = std::hypot(goal->pan - angles->pan, goal->tilt - angles->tilt) + rate * kFollows;
  return sight;
}

void HeadControl::remember(const VehicleState& state, int64_t now_ns,
                           const std::optional<Eigen::Quaterniond>& world_from_body) {
  const double dt = seconds(now_ns - state.timestamp_ns);
  const Eigen::Quaterniond body_from_pad =
      (so3_exp(dt * state.body_angular_velocity_in_pad) * state.pad_from_body.rotation).conjugate();
  const Eigen::Vector3d body_in_pad = state.pad_from_body.translation + dt * state.body_velocity_in_pad;
  const Eigen::Vector3d target_in_pad = inverse(chain_.target_from_pad).translation;
  const Eigen::Quaterniond turn = world_from_body.value_or(Eigen::Quaterniond::Identity()) * body_from_pad;
  seen_ = {now_ns, turn * (target_in_pad - body_in_pad), turn * -state.body_velocity_in_pad,
           world_from_body.has_value()};
}

bool HeadControl::remember(const Glimpse& glimpse, int64_t now_ns,
                           const std::optional<Eigen::Quaterniond>& world_from_body, const PtzCamera& head) {
  const auto angles = head.expected_at(glimpse.time_ns);
  if (!angles) return false;
  const Eigen::Vector3d target = chain_.body_from_base.value_or(Rigid3{}) *
                                 (base_from_camera(chain_, angles) * glimpse.target_in_camera);
  const bool same = seen_ && seen_->in_world == world_from_body.has_value();
  const Eigen::Vector3d velocity = same ? seen_->velocity : Eigen::Vector3d(Eigen::Vector3d::Zero());
  seen_ = {now_ns, world_from_body.value_or(Eigen::Quaterniond::Identity()) * target, velocity,
           world_from_body.has_value()};
  return true;
}

// The target as last seen, taken on by the velocity, at the attitude now.
HeadAngles HeadControl::expected(int64_t time_ns,
                                 const std::optional<Eigen::Quaterniond>& world_from_body) const {
  if (!seen_) return {};
  const bool world = seen_->in_world && world_from_body;
  const double dt = world ? std::min(seconds(time_ns - seen_->time_ns), kMostCarried) : 0;
  const Eigen::Vector3d target = seen_->target + dt * seen_->velocity;
  return centring(world ? world_from_body->conjugate() * target : target).value_or(HeadAngles{});
}

double HeadControl::speed(const AxisLimits& axis, double goal, double goal_rate, double angle) const {
  const double error = goal - angle;
  if (std::abs(error) < options_.dead_band * view_ / widest_ && std::abs(goal_rate) < axis.speed_step / 2)
    return 0;
  return std::clamp(goal_rate + options_.gain * error, -axis.max_speed, axis.max_speed);
}

std::optional<HeadControl::Move> HeadControl::update(int64_t now_ns, const std::optional<VehicleState>& state,
                                                     const std::optional<Eigen::Quaterniond>& world_from_body,
                                                     const PtzCamera& head,
                                                     const std::optional<Glimpse>& glimpse) {
  const bool tracked = state && state->source != StateSource::kLost;
  const int64_t then_ns = now_ns + nanoseconds(options_.lag), step_ns = nanoseconds(kStep);
  std::optional<HeadAngles> before, after;
  if (tracked) {
    lost_since_ns_.reset();
    if (state->source == StateSource::kVision || !seen_) remember(*state, now_ns, world_from_body);
    before = centring(*state, then_ns - step_ns);
    after = centring(*state, then_ns + step_ns);
  } else if (glimpse && remember(*glimpse, now_ns, world_from_body, head)) {
    lost_since_ns_.reset();
    before = expected(then_ns - step_ns, world_from_body);
    after = expected(then_ns + step_ns, world_from_body);
  } else {
    if (!lost_since_ns_) lost_since_ns_ = now_ns;
    const HeadAngles expect = expected(then_ns, world_from_body);
    before = search_.at(seconds(then_ns - step_ns - *lost_since_ns_), expect);
    after = search_.at(seconds(then_ns + step_ns - *lost_since_ns_), expect);
  }
  auto angles = head.expected_at(then_ns);
  if (!angles) angles = head.expected_at(now_ns);
  if (!before || !after || !angles) return std::nullopt;
  Move move;
  move.searching = lost_since_ns_.has_value();
  move.goal.pan = speed(model_.pan, (before->pan + after->pan) / 2, (after->pan - before->pan) / (2 * kStep),
                        angles->pan);
  move.goal.tilt = speed(model_.tilt, (before->tilt + after->tilt) / 2,
                         (after->tilt - before->tilt) / (2 * kStep), angles->tilt);
  return move;
}

}  // namespace perch
