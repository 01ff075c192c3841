#include "perch/links/mavlink/vehicle_history.h"

#include <cmath>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

// After this long without the better source the next one counts.
constexpr int64_t kSourceSilent = 500'000'000;
// Further away nobody flies by a local position; a number beyond is garbage.
constexpr double kFarthest = 1e6;  // m
// A position this far from where the velocity leads was set anew.
constexpr double kJump = 0.5;          // m
constexpr double kAcceleration = 5.0;  // m/s^2, what flight alone may add

constexpr uint16_t kYawLock = 16, kYawInVehicleFrame = 32, kYawInEarthFrame = 64;  // GIMBAL_DEVICE_FLAGS

double seconds(int64_t ns) { return static_cast<double>(ns) * 1e-9; }

bool usable(const Vector3d& v, double limit) { return v.allFinite() && v.cwiseAbs().maxCoeff() < limit; }

// w, x, y, z from the wire; empty when they are no rotation.
std::optional<Quaterniond> rotation_of(double w, double x, double y, double z) {
  const Quaterniond q(w, x, y, z);
  // A float's unit quaternion is off by 1e-7; by 10 % it is none.
  if (!q.coeffs().allFinite() || std::abs(q.norm() - 1) > 0.1) return std::nullopt;
  return q.normalized();
}

}  // namespace

bool VehicleHistory::Source::gives_way(int other_rank, int64_t other_time_ns) const {
  return other_rank <= rank || time_ns == 0 || other_time_ns - time_ns > kSourceSilent;
}

bool VehicleHistory::add_attitude(int rank, const Quaterniond& ned_from_body, const Vector3d& rate,
                                  int64_t time_ns) {
  if (!attitude_source_.gives_way(rank, time_ns)) return false;
  // A rate may be missing (NaN); the attitude is worth having without.
  const Vector3d known_rate = usable(rate, 100) ? rate : Vector3d::Zero();
  if (!attitudes_.add({time_ns, ned_from_body, known_rate})) return false;
  attitude_source_ = {rank, time_ns};
  return true;
}

bool VehicleHistory::add(const AttitudeQuaternion& m, int64_t time_ns) {
  const auto rotation = rotation_of(m.q1, m.q2, m.q3, m.q4);
  return rotation && add_attitude(1, *rotation, {m.rollspeed, m.pitchspeed, m.yawspeed}, time_ns);
}

bool VehicleHistory::add(const AttitudeSample& sample) {
  return add_attitude(1, sample.ned_from_body, sample.body_rate, sample.time_ns);
}

bool VehicleHistory::add(const Attitude& m, int64_t time_ns) {
  if (!usable({m.roll, m.pitch, m.yaw}, 100)) return false;
  const Quaterniond rotation = rotation_from_ypr({m.yaw, m.pitch, m.roll});
  return add_attitude(2, rotation, {m.rollspeed, m.pitchspeed, m.yawspeed}, time_ns);
}

bool VehicleHistory::add(const Odometry& m, int64_t time_ns) {
  const auto rotation = rotation_of(m.q[0], m.q[1], m.q[2], m.q[3]);
  if (m.frame_id != mav_frame::kLocalNed || !rotation) return false;
  const bool attitude = add_attitude(3, *rotation, {m.rollspeed, m.pitchspeed, m.yawspeed}, time_ns);

  MotionSample motion{time_ns, {m.x, m.y, m.z}, {m.vx, m.vy, m.vz}, 0};
  if (m.child_frame_id == mav_frame::kBodyFrd) {
    motion.body_velocity_in_ned = *rotation * motion.body_velocity_in_ned;
  } else if (m.child_frame_id != mav_frame::kLocalNed) {
    return attitude;
  }
  if (reset_counter_ && *reset_counter_ != m.reset_counter) ++resets_;
  reset_counter_ = m.reset_counter;
  return add_motion(1, motion) || attitude;
}

bool VehicleHistory::add(const LocalPositionNed& m, int64_t time_ns) {
  return add_motion(2, {time_ns, {m.x, m.y, m.z}, {m.vx, m.vy, m.vz}, 0});
}

bool VehicleHistory::add_motion(int rank, MotionSample sample) {
  if (!usable(sample.body_in_ned, kFarthest) || !usable(sample.body_velocity_in_ned, 1e3)) return false;
  if (!motion_source_.gives_way(rank, sample.time_ns)) return false;
  const MotionSample* last = motions_.latest();
  if (last && sample.time_ns > last->time_ns) {
    // Whoever does not count resets still shows them.
    const double dt = seconds(sample.time_ns - last->time_ns);
    const Vector3d mean_velocity = (last->body_velocity_in_ned + sample.body_velocity_in_ned) / 2;
    const Vector3d off = sample.body_in_ned - last->body_in_ned - mean_velocity * dt;
    if (off.norm() > kJump + kAcceleration * dt * dt) ++resets_;
  }
  sample.resets = resets_;
  if (!motions_.add(sample)) return false;
  motion_source_ = {rank, sample.time_ns};
  return true;
}

bool VehicleHistory::add(const GimbalDeviceAttitudeStatus& m, uint8_t component, int64_t time_ns) {
  const auto rotation = rotation_of(m.q[0], m.q[1], m.q[2], m.q[3]);
  return rotation && gimbal_.add({time_ns, component, m.flags, *rotation});
}

bool VehicleHistory::add(const DistanceSensor& m, int64_t time_ns) {
  if (m.orientation != kOrientationDown) return false;
  return ranges_.add(
      {time_ns, 0.01 * m.current_distance, 0.01 * m.min_distance, 0.01 * m.max_distance, m.orientation});
}

std::optional<AttitudeSample> VehicleHistory::attitude_at(int64_t time_ns) const {
  const auto around = attitudes_.around(time_ns);
  if (!around) return std::nullopt;
  const auto& [before, after] = *around;
  AttitudeSample sample = *before;
  sample.time_ns = time_ns;
  const int64_t past = time_ns - before->time_ns;
  if (!after) {
    if (past > kMaxAttitudeAhead) return std::nullopt;
    sample.ned_from_body = before->ned_from_body * so3_exp(before->body_rate * seconds(past));
    return sample;
  }
  if (after->time_ns - before->time_ns > kMaxAttitudeGap) return std::nullopt;
  const double s = seconds(past) / seconds(after->time_ns - before->time_ns);
  sample.ned_from_body = before->ned_from_body.slerp(s, after->ned_from_body);
  sample.body_rate = (1 - s) * before->body_rate + s * after->body_rate;
  return sample;
}

std::optional<GimbalSample> VehicleHistory::gimbal_at(int64_t time_ns) const {
  const auto around = gimbal_.around(time_ns);
  if (!around) return std::nullopt;
  const auto& [before, after] = *around;
  const int64_t past = time_ns - before->time_ns;
  if (past > (after ? 2 : 1) * kMaxGimbalAhead) return std::nullopt;
  GimbalSample sample = *before;
  sample.time_ns = time_ns;
  if (!after) return sample;
  const int64_t gap = after->time_ns - before->time_ns;
  // Rotations against different axes have none between them.
  if (gap > 2 * kMaxGimbalAhead || after->flags != before->flags) return std::nullopt;
  sample.rotation = before->rotation.slerp(seconds(past) / seconds(gap), after->rotation);
  return sample;
}

std::optional<MotionSample> VehicleHistory::motion_at(int64_t time_ns) const {
  const auto around = motions_.around(time_ns);
  if (!around) return std::nullopt;
  const auto& [before, after] = *around;
  MotionSample sample = *before;
  sample.time_ns = time_ns;
  const double past = seconds(time_ns - before->time_ns);
  if (!after) {
    if (time_ns - before->time_ns > kMaxMotionAhead) return std::nullopt;
    sample.body_in_ned += before->body_velocity_in_ned * past;
    return sample;
  }
  if (after->time_ns - before->time_ns > kMaxMotionGap) return std::nullopt;
  // Across a reset neither end's map holds in between; at a sample itself its own does.
  if (after->resets != before->resets) return past == 0 ? std::optional(sample) : std::nullopt;
  // Cubic Hermite: both positions and both velocities.
  const double gap = seconds(after->time_ns - before->time_ns);
  const double s = past / gap;
  const double h = s * s * (3 - 2 * s);
  sample.body_in_ned =
      (1 - h) * before->body_in_ned + h * after->body_in_ned +
      gap * s * (1 - s) * ((1 - s) * before->body_velocity_in_ned - s * after->body_velocity_in_ned);
  sample.body_velocity_in_ned = (1 - s) * before->body_velocity_in_ned + s * after->body_velocity_in_ned;
  return sample;
}

void VehicleHistory::clear() {
  attitudes_.clear();
  motions_.clear();
  gimbal_.clear();
  ranges_.clear();
  attitude_source_ = motion_source_ = {};
  reset_counter_.reset();
  ++resets_;
}

Quaterniond ned_from_gimbal(const GimbalSample& gimbal, const Quaterniond& ned_from_body) {
  // Gimbals from before the two frame flags tell by the lock alone.
  const bool earth = (gimbal.flags & kYawInEarthFrame) ||
                     (!(gimbal.flags & kYawInVehicleFrame) && (gimbal.flags & kYawLock));
  if (earth) return gimbal.rotation;
  const Vector3d forward = ned_from_body * Vector3d::UnitX();
  return Eigen::AngleAxisd(std::atan2(forward.y(), forward.x()), Vector3d::UnitZ()) * gimbal.rotation;
}

}  // namespace perch::mavlink
