#include "perch/links/mavlink/gimbal_camera.h"

#include <cmath>
#include <limits>
#include <utility>

#include "perch/geometry/euler.h"
#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kAskAgain = 500 * kMs;
// The rate that managers take without trouble (10 to 20 Hz).
constexpr int64_t kBetweenCommands = 50 * kMs;
// Between two statuses further apart, and further beyond the last, it is not known where it looks.
constexpr int64_t kMostGap = 200 * kMs, kMostAhead = 60 * kMs;
// A status is as old as the link and the gimbal's own filter make it; gimbals turn at some rad/s.
constexpr double kTimeSigma = 0.01;  // s
constexpr double kSigma = 0.003;     // rad, of its own attitude: a tenth of a degree and more

}  // namespace

GimbalCamera::GimbalCamera(const GimbalOptions& options, const VehicleHistory& history)
    : options_(options), history_(history) {}

void GimbalCamera::receive(const CommandAck& ack) {
  const bool to_us = (ack.target_system == 0 || ack.target_system == options_.our_system) &&
                     (ack.target_component == 0 || ack.target_component == options_.our_component);
  if (to_us && ack.command == mav_command::kGimbalManagerConfigure)
    control_ = ack.result == mav_result::kAccepted;
}

void GimbalCamera::receive(const GimbalManagerStatus& status) {
  if (options_.device != 0 && status.gimbal_device_id != options_.device) return;
  control_ = status.primary_control_sysid == options_.our_system &&
             status.primary_control_compid == options_.our_component;
}

void GimbalCamera::point(const HeadGoal& goal) {
  if (!std::isfinite(goal.pan) || !std::isfinite(goal.tilt)) return;
  goal_ = goal;
  if (goal.kind != HeadGoal::Kind::kRelative) return;
  const auto now = at(now_ns_);
  if (!now) return goal_.reset();
  goal_ = {HeadGoal::Kind::kAbsolute, now->pan + goal.pan, now->tilt + goal.tilt};
}

GimbalCamera::Outgoing GimbalCamera::tick(int64_t now_ns) {
  now_ns_ = now_ns;
  Outgoing out;
  if (!control_) {
    if (asked_ns_ && now_ns - *asked_ns_ < kAskAgain) return out;
    asked_ns_ = now_ns;
    CommandLong& command = out.command.emplace();
    command.command = mav_command::kGimbalManagerConfigure;
    command.target_system = options_.system;
    command.target_component = options_.manager;
    command.param1 = options_.our_system;
    command.param2 = options_.our_component;
    command.param3 = command.param4 = -1;  // the secondary's control as it is
    command.param7 = options_.device;
    return out;
  }
  if (!goal_ || now_ns - sent_ns_ < kBetweenCommands) return out;
  sent_ns_ = now_ns;
  out.set = set_of(*std::exchange(goal_, std::nullopt));
  return out;
}

// Angles or rates; what is not meant is NaN.
GimbalManagerSetPitchyaw GimbalCamera::set_of(const HeadGoal& goal) const {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  GimbalManagerSetPitchyaw set;
  set.flags = kGimbalYawInVehicleFrame;
  set.target_system = options_.system;
  set.target_component = options_.manager;
  set.gimbal_device_id = options_.device;
  set.pitch = set.yaw = set.pitch_rate = set.yaw_rate = kNone;
  if (goal.kind == HeadGoal::Kind::kDrive) {
    set.pitch_rate = static_cast<float>(goal.tilt);
    set.yaw_rate = static_cast<float>(goal.pan);
    return set;
  }
  set.pitch = static_cast<float>(goal.tilt);
  set.yaw = static_cast<float>(goal.pan);
  return set;
}

std::optional<HeadAngles> GimbalCamera::at(int64_t time_ns) const {
  const auto attitude = history_.attitude_at(time_ns);
  const auto around = history_.gimbal().around(time_ns);
  if (!attitude || !around) return std::nullopt;
  const auto& [before, after] = *around;
  if (after ? after->time_ns - before->time_ns > kMostGap : time_ns - before->time_ns > kMostAhead)
    return std::nullopt;
  if (after && after->flags != before->flags) return std::nullopt;  // two frames of its yaw
  GimbalSample sample = *before;
  double moved = 0;  // rad/s
  if (after) {
    const double gap = static_cast<double>(after->time_ns - before->time_ns);
    sample.rotation =
        before->rotation.slerp(static_cast<double>(time_ns - before->time_ns) / gap, after->rotation);
    moved = before->rotation.angularDistance(after->rotation) / (gap * 1e-9);
  }
  const Eigen::Quaterniond body_from_gimbal =
      attitude->ned_from_body.conjugate() * ned_from_gimbal(sample, attitude->ned_from_body);
  const YawPitchRoll ypr = ypr_from_rotation(body_from_gimbal);
  const double sigma = std::hypot(kSigma, moved * kTimeSigma,
                                  after ? 0 : kTimeSigma * static_cast<double>(time_ns > before->time_ns));
  return HeadAngles{ypr.yaw, ypr.pitch, sigma, sigma, ypr.roll};
}

}  // namespace perch::mavlink
