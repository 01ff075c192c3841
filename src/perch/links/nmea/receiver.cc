#include "perch/links/nmea/receiver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"

namespace perch::nmea {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;

// Beyond these a position is garbage, or has to be confirmed: what the last one's velocity leads to, with an
// acceleration of 2 g and the receiver's own noise; or, where that velocity is not known, how fast a vehicle
// over its pad may be.
constexpr double kMostAcceleration = 20, kMostNoise = 1;                        // m/s^2, m
constexpr double kMostSpeed = 40, kMostJump = 5;                                // m/s, m
constexpr double kMostTurn = 300 * kRadFromDeg, kMostSwing = 10 * kRadFromDeg;  // rad/s, rad
constexpr double kMostSpeedError = 15;  // m/s: RMC's velocity against the positions' own
// Sentences of one moment have the same time, in as many digits as the receiver gives it.
constexpr int64_t kSameMoment = 5 * kMs;
// How long a position waits for what usually comes with it.
constexpr int64_t kPatience = 250 * kMs;
constexpr int64_t kUsual = 2 * kSecond;
constexpr int64_t kFixLost = 3 * kSecond;
// A heading of its own sentence stands in for one that an attitude lacks; at 30 deg/s it is off by 6 deg
// then.
constexpr int64_t kHeadingGood = 200 * kMs;
constexpr double kUsualTurn = 0.5;  // rad/s
// Between attitudes further apart no rate can be told.
constexpr int64_t kRateWithin = 200 * kMs;
constexpr size_t kMostWaiting = 100;
constexpr auto kSaidPeriod = static_cast<int64_t>(1e9 / 60);  // as AutopilotFeed's
// What is new in each attitude; of one that comes without its time also the line's delay: 20 ms at 0.5 rad/s.
constexpr double kAttitudeSigma = 0.005, kUntimedSigma = 0.01;  // rad

double seconds(int64_t ns) { return 1e-9 * static_cast<double>(ns); }

// The usual error of a pseudorange, or what comes of carrier phases, for HDOP 1: m, both axes together.
double range_error(FixQuality quality) {
  switch (quality) {
    case FixQuality::kGnss:
      return 4;
    case FixQuality::kDifferential:
      return 1.5;
    case FixQuality::kPps:
      return 2;
    case FixQuality::kRtk:
      return 0.02;
    case FixQuality::kRtkFloat:
      return 0.4;
    case FixQuality::kNone:
      break;
  }
  return 0;
}

}  // namespace

void Receiver::Rate::count(int64_t now_ns) {
  if (now_ns - last_ns_ > 4 * kSecond) *this = {};
  if (counted_ == 0) begin_ns_ = now_ns;
  last_ns_ = now_ns;
  if (now_ns - begin_ns_ >= 2 * kSecond) {
    hz_ = counted_ / seconds(now_ns - begin_ns_);
    begin_ns_ = now_ns;
    counted_ = 0;
  }
  ++counted_;
}

double Receiver::Rate::hz(int64_t now_ns) const { return now_ns - last_ns_ > 4 * kSecond ? 0 : hz_; }

Receiver::Receiver(const ReceiverOptions& options) : options_(options) {
  if (options_.origin) frame_.emplace(*options_.origin);
}

void Receiver::receive(std::span<const uint8_t> bytes, int64_t arrival_ns) {
  parser_.parse(bytes, arrival_ns, [&](const Sentence& sentence) {
    std::visit(
        [&](const auto& message) {
          using Kind = std::decay_t<decltype(message)>;
          if constexpr (std::is_same_v<Kind, Malformed>) {
            ++statistics_.malformed;
          } else if constexpr (!std::is_same_v<Kind, Unknown>) {
            handle(message, sentence.arrival_ns);
          }
        },
        decode(sentence));
  });
}

std::optional<int64_t> Receiver::time_of(int64_t of_day_ns, int64_t arrival_ns) {
  const bool fits = clock_.take(of_day_ns, arrival_ns);
  if (clock_.steps() != clock_steps_) {
    clock_steps_ = clock_.steps();
    // What is there was placed by a clock that has been set.
    history_.clear();
    fixes_.forget();
    attitudes_.forget();
    pending_.clear();
    said_.clear();
    last_.reset();
    last_velocity_.reset();
    velocity_.reset();
    last_said_ns_ = 0;
  }
  if (!fits) {
    ++statistics_.times_refused;
    return std::nullopt;
  }
  return clock_.local_from_utc(of_day_ns, arrival_ns);
}

void Receiver::handle(const Gga& message, int64_t arrival_ns) {
  if (message.quality == FixQuality::kNone) {
    ++statistics_.no_fix;
    quality_ = message.quality;
    return;
  }
  const auto time_ns = time_of(message.of_day_ns, arrival_ns);
  if (!time_ns) return;
  const Fix fix{*time_ns, arrival_ns, message.place};
  if (fixes_.last() && fix.time_ns <= fixes_.last()->time_ns + kSameMoment) {
    ++statistics_.repeated;  // two receivers on one line, or a datagram twice
    return;
  }
  const bool follows = fixes_.take(fix, [&](const Fix& a, const Fix& b) {
    const double dt = seconds(b.time_ns - a.time_ns);
    const Vector3d way = LocalFrame(a.place).ned(b.place);
    if (!last_ || last_->time_ns != a.time_ns) return dt > 0 && way.norm() < kMostJump + kMostSpeed * dt;
    return is_flown(way, dt);
  });
  if (!follows) {
    ++statistics_.jumps_refused;
    return;
  }
  quality_ = message.quality;
  satellites_ = message.satellites;
  hdop_ = message.hdop;
  add_fix(fix);
}

// From the last fix on.
bool Receiver::is_flown(const Vector3d& way, double dt) const {
  if (!last_velocity_) return dt > 0 && way.norm() < kMostJump + kMostSpeed * dt;
  return (way - *last_velocity_ * dt).norm() < kMostNoise + kMostAcceleration / 2 * dt * dt;
}

void Receiver::add_fix(const Fix& fix) {
  ++statistics_.fixes;
  fix_rate_.count(fix.arrival_ns);
  last_fix_ns_ = fix.arrival_ns;
  if (!frame_) frame_.emplace(fix.place);
  Pending pending;
  pending.arrival_ns = fix.arrival_ns;
  pending.fix.time_ns = fix.time_ns;
  pending.fix.body_in_ned = frame_->ned(fix.place);
  // A jump, though others confirmed it, is no way that was flown.
  if (last_ && fix.time_ns - last_->time_ns < kUsual &&
      is_flown(pending.fix.body_in_ned - last_->body_in_ned, seconds(fix.time_ns - last_->time_ns))) {
    pending.fix.body_velocity_in_ned =
        (pending.fix.body_in_ned - last_->body_in_ned) / seconds(fix.time_ns - last_->time_ns);
    pending.by_positions = true;
    last_velocity_ = pending.fix.body_velocity_in_ned;
  } else {
    last_velocity_.reset();
  }
  last_ = pending.fix;
  give_velocity(pending);
  if (pending_.size() >= kMostWaiting) pending_.pop_front();
  pending_.push_back(pending);
}

// RMC's comes of Doppler shifts and is of the moment; that between positions is of half a period before.
// There is none for the vertical in any sentence.
void Receiver::give_velocity(Pending& pending) {
  PositionFix& fix = pending.fix;
  if (!velocity_ || std::abs(velocity_->time_ns - fix.time_ns) > kSameMoment) return;
  pending.has_velocity = true;
  if (!pending.by_positions ||
      (velocity_->north_east - fix.body_velocity_in_ned.head<2>()).norm() < kMostSpeedError)
    fix.body_velocity_in_ned.head<2>() = velocity_->north_east;
  if (last_velocity_ && fix.time_ns == last_->time_ns) last_velocity_ = fix.body_velocity_in_ned;
}

void Receiver::handle(const Rmc& message, int64_t arrival_ns) {
  if (!message.valid) return;
  const auto time_ns = time_of(message.of_day_ns, arrival_ns);
  // Receivers that stand leave the course out.
  const bool stands = message.speed && !message.course && *message.speed < 0.3;
  if (!time_ns || !message.speed || !(message.course || stands)) return;
  const double course = message.course.value_or(0);
  velocity_ = {*time_ns, arrival_ns, *message.speed * Eigen::Vector2d(std::cos(course), std::sin(course))};
  for (Pending& pending : pending_) give_velocity(pending);
}

void Receiver::handle(const Gst& message, int64_t arrival_ns) {
  if (!message.north || !message.east || !message.up || !time_of(message.of_day_ns, arrival_ns)) return;
  gst_ = message;
  last_gst_ns_ = arrival_ns;
}

void Receiver::handle(const TrueHeading& message, int64_t arrival_ns) {
  heading_ = message.heading;
  heading_ns_ = arrival_ns;
}

void Receiver::handle(const Attitude& message, int64_t arrival_ns) {
  const auto time_ns = message.of_day_ns ? time_of(*message.of_day_ns, arrival_ns) : arrival_ns;
  const bool heading_good = heading_ && arrival_ns - heading_ns_ < kHeadingGood;
  const auto heading = message.heading || !heading_good ? message.heading : heading_;
  if (!time_ns || !heading) return;
  const Lying now{*time_ns, rotation_from_ypr({*heading, message.pitch, message.roll})};
  const auto before = attitudes_.last();
  if (before && now.time_ns <= before->time_ns) {
    ++statistics_.repeated;
    return;
  }
  const bool follows = attitudes_.take(now, [](const Lying& a, const Lying& b) {
    const double dt = seconds(b.time_ns - a.time_ns);
    return dt > 0 && a.ned_from_body.angularDistance(b.ned_from_body) < kMostSwing + kMostTurn * dt;
  });
  if (!follows) {
    ++statistics_.jumps_refused;
    return;
  }
  Vector3d rate = Vector3d::Zero();
  // A heading that is new since would turn by all it had gathered.
  const bool stood_in = !message.heading;
  const bool same_heading = !stood_in || heading_ns_ == stood_in_ns_;
  if (stood_in) stood_in_ns_ = heading_ns_;
  if (before && same_heading && now.time_ns - before->time_ns <= kRateWithin) {
    rate = so3_log(before->ned_from_body.conjugate() * now.ned_from_body) /
           seconds(now.time_ns - before->time_ns);
  }
  history_.add(mavlink::AttitudeSample{now.time_ns, now.ned_from_body, rate});
  ++statistics_.attitudes;
  attitude_rate_.count(arrival_ns);
  if (now.time_ns - last_said_ns_ < kSaidPeriod || said_.size() >= kMostWaiting) return;
  last_said_ns_ = now.time_ns;
  AutopilotSample sample;
  sample.timestamp_ns = now.time_ns;
  sample.world_from_body = now.ned_from_body;
  sample.attitude_sigma =
      std::max(message.of_day_ns ? kAttitudeSigma : kUntimedSigma, message.sigma.value_or(0));
  if (stood_in)
    sample.attitude_sigma = std::hypot(sample.attitude_sigma, kUsualTurn * seconds(arrival_ns - heading_ns_));
  said_.push_back(sample);
}

bool Receiver::complete(const Pending& pending, int64_t now_ns) const {
  if (now_ns - pending.arrival_ns > kPatience) return true;
  const bool velocity_comes = velocity_ && now_ns - velocity_->arrival_ns < kUsual;
  const auto* attitude = history_.attitudes().latest();
  const bool attitude_comes = attitude && now_ns - attitude->time_ns < kUsual;
  return (pending.has_velocity || !velocity_comes) &&
         (!attitude_comes || attitude->time_ns >= pending.fix.time_ns);
}

std::vector<PositionFix> Receiver::take_fixes(int64_t now_ns) {
  std::vector<PositionFix> fixes;
  for (; !pending_.empty() && complete(pending_.front(), now_ns); pending_.pop_front()) {
    PositionFix fix = pending_.front().fix;
    // Not beyond the last attitude: what is recorded is known, not expected.
    const auto* latest = history_.attitudes().latest();
    if (latest && latest->time_ns >= fix.time_ns) {
      if (const auto attitude = history_.attitude_at(fix.time_ns))
        fix.ned_from_body = attitude->ned_from_body;
    }
    fixes.push_back(fix);
  }
  return fixes;
}

std::vector<AutopilotSample> Receiver::take_attitudes() { return std::exchange(said_, {}); }

FixQuality Receiver::quality(int64_t now_ns) const {
  return last_fix_ns_ != 0 && now_ns - last_fix_ns_ < kFixLost ? quality_ : FixQuality::kNone;
}

std::optional<PositionAccuracy> Receiver::accuracy(int64_t now_ns) const {
  if (quality(now_ns) == FixQuality::kNone) return std::nullopt;
  if (last_gst_ns_ != 0 && now_ns - last_gst_ns_ < kFixLost)
    return PositionAccuracy{std::hypot(*gst_.north, *gst_.east) / std::sqrt(2.0), *gst_.up, true};
  if (!hdop_) return std::nullopt;
  const double horizontal = *hdop_ * range_error(quality_) / std::sqrt(2.0);
  // Satellites are above only: heights are worse, by half as much again and more.
  return PositionAccuracy{horizontal, 2 * horizontal, false};
}

}  // namespace perch::nmea
