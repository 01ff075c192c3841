#include "perch/links/mavlink/landing_output.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/so3.h"
#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

// A capture may seem this much later than now where its clock was matched to ours by an estimate.
constexpr int64_t kFutureSlack = 5'000'000;
// What AC_PrecLand allows PLND_LAG to be.
constexpr double kLeastLag = 0.02, kMostLag = 0.25;  // s
// Nearer than this there is no direction to the pad's centre.
constexpr double kLeastDistance = 1e-3;  // m
constexpr double kFarthest = 1e4;        // m

double seconds(int64_t ns) { return static_cast<double>(ns) * 1e-9; }

LandingMessage refused(LandingRefusal why) { return {why, std::nullopt, std::nullopt}; }

bool usable(const std::optional<Vector3d>& v) { return !v || v->allFinite(); }

bool usable(const PadSighting& sighting) {
  const Rigid3& pose = sighting.body_from_pad.mean;
  const PoseCovariance& covariance = sighting.body_from_pad.covariance;
  const double distance = pose.translation.norm();
  return pose.translation.allFinite() && distance > kLeastDistance && distance < kFarthest &&
         pose.rotation.coeffs().allFinite() && std::abs(pose.rotation.norm() - 1) < 1e-3 &&
         covariance.allFinite() && covariance.diagonal().minCoeff() >= 0 && usable(sighting.velocity) &&
         usable(sighting.rate);
}

uint64_t microseconds(int64_t ns) { return static_cast<uint64_t>(ns / 1000); }

// The fields that are alike in both frames of LANDING_TARGET; the angles are those of ArduPilot's angle mode,
// body = (-tan(angle_y), tan(angle_x), 1). q stays zero: identity would say "the pad's yaw is 0".
LandingTarget target_at(const Vector3d& pad_in_body, int64_t capture_ns) {
  LandingTarget message;
  message.time_usec = microseconds(capture_ns);
  message.angle_x = static_cast<float>(std::atan2(pad_in_body.y(), pad_in_body.z()));
  message.angle_y = static_cast<float>(std::atan2(-pad_in_body.x(), pad_in_body.z()));
  message.type = kTargetTypeFiducial;
  message.position_valid = 1;
  return message;
}

void set_position(LandingTarget& message, const Vector3d& p) {
  message.x = static_cast<float>(p.x());
  message.y = static_cast<float>(p.y());
  message.z = static_cast<float>(p.z());
}

// The norm of what is really sent: ArduPilot divides by it.
float norm_of_sent(const LandingTarget& message) {
  return static_cast<float>(Vector3d(message.x, message.y, message.z).norm());
}

std::array<float, 4> wxyz(const Quaterniond& rotation) {
  const Eigen::Quaternionf q = positive_w(rotation).cast<float>();
  return {q.w(), q.x(), q.y(), q.z()};
}

// The sum of the squared correlations: 0 when the matrix is diagonal.
double correlation(const Matrix3d& covariance) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) {
      const double scale = covariance(i, i) * covariance(j, j);
      if (scale > 0) sum += covariance(i, j) * covariance(i, j) / scale;
    }
  }
  return sum;
}

float standard_deviation(double variance) { return static_cast<float>(std::sqrt(std::max(0.0, variance))); }

// How far the body moves relative to the pad from the exposure to the target time, in the body's axes at the
// exposure. The velocity is the filter's, relative to the pad; or the autopilot's, which is the same for a
// pad that does not move. How it changes meanwhile the autopilot knows, and the pad's own change is small.
Vector3d displacement(const PadSighting& sighting, const VehicleHistory& history, int64_t target_ns) {
  const double dt = seconds(target_ns - sighting.capture_ns);
  const auto attitude = history.attitude_at(sighting.capture_ns);
  const auto then = history.motion_at(sighting.capture_ns), at_target = history.motion_at(target_ns);
  Vector3d velocity = sighting.velocity.value_or(Vector3d::Zero());
  if (!attitude || !then) return velocity * dt;
  const Quaterniond body_from_ned = attitude->ned_from_body.conjugate();
  if (!sighting.velocity) velocity = body_from_ned * then->body_velocity_in_ned;
  if (at_target && at_target->resets == then->resets)
    velocity += body_from_ned * (at_target->body_velocity_in_ned - then->body_velocity_in_ned) / 2;
  return velocity * dt;
}

}  // namespace

std::string_view name_of(LandingProfile profile) {
  constexpr std::string_view kNames[] = {"none", "ardupilot", "px4", "px4-vte"};
  return kNames[static_cast<size_t>(profile)];
}

std::optional<LandingProfile> profile_named(std::string_view name) {
  for (const LandingProfile profile :
       {LandingProfile::kArdupilot, LandingProfile::kPx4, LandingProfile::kPx4Vte}) {
    if (name == name_of(profile)) return profile;
  }
  return std::nullopt;
}

LandingProfile profile_for(const Autopilot& autopilot, const ParameterReader& parameters) {
  if (autopilot.is_ardupilot()) return LandingProfile::kArdupilot;
  if (!autopilot.is_px4()) return LandingProfile::kNone;
  // While it is not known whether the estimator runs, either message may be the wrong one.
  const auto estimator = parameters.values().find("VTE_EN");
  if (estimator != parameters.values().end())
    return estimator->second == 1 ? LandingProfile::kPx4Vte : LandingProfile::kPx4;
  return parameters.absent().count("VTE_EN") ? LandingProfile::kPx4 : LandingProfile::kNone;
}

std::string_view name_of(LandingRefusal refusal) {
  constexpr std::string_view kNames[kLandingRefusals] = {"none",        "no link", "untrusted", "not finite",
                                                         "stale",       "future",  "repeated",  "no attitude",
                                                         "no position", "reset"};
  return kNames[static_cast<size_t>(refusal)];
}

PadSighting sighting_from(const VehicleState& state, int64_t capture_ns, bool trusted) {
  PadSighting sighting;
  sighting.capture_ns = capture_ns;
  sighting.body_from_pad =
      inverse(UncertainRigid3{state.pad_from_body, state.covariance.topLeftCorner<6, 6>()});
  const Quaterniond body_from_pad = state.pad_from_body.rotation.conjugate();
  sighting.velocity = body_from_pad * state.body_velocity_in_pad;
  sighting.rate = body_from_pad * state.body_angular_velocity_in_pad;
  sighting.trusted = trusted;
  return sighting;
}

// The vector from the body to the pad, by the body's axes R at the exposure c and at the moment t which
// ArduPilot will attribute it to:  p(t) = R(t)^T R(c) (p(c) - d),  d the displacement. Without attitudes
// R(c)^T R(t) = Exp(w (t - c)).
LandingMessage ardupilot_message(const PadSighting& sighting, const VehicleHistory& history,
                                 int64_t target_ns) {
  const auto then = history.attitude_at(sighting.capture_ns);
  const auto at_target = history.attitude_at(target_ns);
  Quaterniond turned = Quaterniond::Identity();  // body at the exposure from body at the target time
  if (then && at_target) {
    turned = then->ned_from_body.conjugate() * at_target->ned_from_body;
  } else if (sighting.rate) {
    turned = so3_exp(*sighting.rate * seconds(target_ns - sighting.capture_ns));
  } else {
    return refused(LandingRefusal::kNoAttitude);
  }
  const Vector3d pad_in_body = turned.conjugate() * (sighting.body_from_pad.mean.translation -
                                                     displacement(sighting, history, target_ns));

  LandingMessage out;
  out.landing_target = target_at(pad_in_body, sighting.capture_ns);
  out.landing_target->frame = mav_frame::kBodyFrd;
  set_position(*out.landing_target, pad_in_body);
  out.landing_target->distance = norm_of_sent(*out.landing_target);
  if (!(out.landing_target->distance > 0)) return refused(LandingRefusal::kNotFinite);
  return out;
}

LandingMessage px4_message(const PadSighting& sighting, const VehicleHistory& history) {
  const auto attitude = history.attitude_at(sighting.capture_ns);
  if (!attitude) return refused(LandingRefusal::kNoAttitude);
  const auto motion = history.motion_at(sighting.capture_ns);
  if (!motion) return refused(LandingRefusal::kNoPosition);
  // The pad would be drawn into a map that has been moved since.
  if (motion->resets != history.motions().latest()->resets) return refused(LandingRefusal::kReset);

  const Vector3d& pad_in_body = sighting.body_from_pad.mean.translation;
  LandingMessage out;
  out.landing_target = target_at(pad_in_body, sighting.capture_ns);
  out.landing_target->frame = mav_frame::kLocalNed;
  set_position(*out.landing_target, motion->body_in_ned + attitude->ned_from_body * pad_in_body);
  out.landing_target->distance = static_cast<float>(pad_in_body.norm());
  return out;
}

// PX4 takes one variance per axis. Of the two frames it knows the one is chosen in which the covariance is
// nearer to diagonal, so that the least is lost.
LandingMessage px4_vte_message(const PadSighting& sighting, const VehicleHistory& history) {
  const auto attitude = history.attitude_at(sighting.capture_ns);
  if (!attitude) return refused(LandingRefusal::kNoAttitude);
  const Matrix3d ned_from_body = attitude->ned_from_body.toRotationMatrix();
  const Rigid3& body_from_pad = sighting.body_from_pad.mean;
  const Matrix3d in_body = sighting.body_from_pad.covariance.topLeftCorner<3, 3>();
  const Matrix3d turn_in_body = sighting.body_from_pad.covariance.bottomRightCorner<3, 3>();
  const Matrix3d in_ned = ned_from_body * in_body * ned_from_body.transpose();
  const bool body = correlation(in_body) < correlation(in_ned);

  const Quaterniond frame_from_body = body ? Quaterniond::Identity() : attitude->ned_from_body;
  const Vector3d position = frame_from_body * body_from_pad.translation;
  const Matrix3d& covariance = body ? in_body : in_ned;
  // The target's axes as PX4 has all axes, z down: half a turn about the pad's x, whose heading is the pad's.
  const Quaterniond pad_from_frd(0, 1, 0, 0);

  TargetRelative message;
  message.timestamp = microseconds(sighting.capture_ns);
  message.frame = body ? target_frame::kBodyFrd : target_frame::kLocalOffsetNed;
  message.x = static_cast<float>(position.x());
  message.y = static_cast<float>(position.y());
  message.z = static_cast<float>(position.z());
  for (int i = 0; i < 3; ++i) message.pos_std[static_cast<size_t>(i)] = standard_deviation(covariance(i, i));
  message.yaw_std = standard_deviation((ned_from_body * turn_in_body * ned_from_body.transpose())(2, 2));
  message.q_target = wxyz(frame_from_body * body_from_pad.rotation * pad_from_frd);
  // From the frame to NED at the exposure; zeros say that the frame is NED already.
  if (body) message.q_sensor = wxyz(attitude->ned_from_body);
  message.type = kTargetTypeFiducial;
  LandingMessage out;
  out.target_relative = message;
  return out;
}

LandingProfile LandingOutput::profile(const VehicleLink& link) const {
  if (options_.profile) return *options_.profile;
  return link.state() == LinkState::kSilent ? LandingProfile::kNone
                                            : profile_for(link.autopilot(), link.parameters());
}

LandingRefusal LandingOutput::refusal_before(const PadSighting& sighting, const VehicleLink& link,
                                             int64_t now_ns) const {
  if (link.state() != LinkState::kUp || profile(link) == LandingProfile::kNone)
    return LandingRefusal::kNoLink;
  if (!sighting.trusted) return LandingRefusal::kUntrusted;
  if (!usable(sighting)) return LandingRefusal::kNotFinite;
  if (sighting.capture_ns > now_ns + kFutureSlack) return LandingRefusal::kFuture;
  if (seconds(now_ns - sighting.capture_ns) > options_.max_age) return LandingRefusal::kStale;
  if (last_capture_ns_ && sighting.capture_ns <= *last_capture_ns_) return LandingRefusal::kRepeated;
  return LandingRefusal::kNone;
}

LandingMessage LandingOutput::message(const PadSighting& sighting, const VehicleLink& link,
                                      int64_t now_ns) const {
  const LandingRefusal before = refusal_before(sighting, link, now_ns);
  if (before != LandingRefusal::kNone) return refused(before);
  switch (profile(link)) {
    case LandingProfile::kPx4:
      return px4_message(sighting, link.history());
    case LandingProfile::kPx4Vte:
      return px4_vte_message(sighting, link.history());
    default:
      break;
  }
  const auto& parameters = link.parameters().values();
  const auto read = parameters.find("PLND_LAG");
  const double lag = std::clamp(read != parameters.end() ? read->second : options_.lag, kLeastLag, kMostLag);
  return ardupilot_message(sighting, link.history(), now_ns - std::llround(lag * 1e9));
}

std::vector<uint8_t> LandingOutput::bytes(const PadSighting& sighting, VehicleLink& link, int64_t now_ns) {
  const LandingMessage out = message(sighting, link, now_ns);
  last_refusal_ = out.refusal;
  ++counts_[static_cast<size_t>(out.refusal)];
  if (out.refusal != LandingRefusal::kNone) return {};
  last_capture_ns_ = sighting.capture_ns;
  return out.landing_target ? link.frame_of(*out.landing_target) : link.frame_of(*out.target_relative);
}

}  // namespace perch::mavlink
