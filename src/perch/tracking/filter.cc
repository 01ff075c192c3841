#include "perch/tracking/filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace perch {
namespace {

// Of times in order. Unsigned: the difference of two times from a broken file may be too large for int64_t.
double seconds(int64_t from_ns, int64_t to_ns) {
  return static_cast<double>(static_cast<uint64_t>(to_ns) - static_cast<uint64_t>(from_ns)) * 1e-9;
}

// Whether `earlier` is before `later` by more than `most` s.
bool is_long_before(int64_t earlier_ns, int64_t later_ns, double most) {
  return earlier_ns < later_ns && seconds(earlier_ns, later_ns) > most;
}

// Finite, and a covariance that is one. Anything else would stay in the state for ever.
bool is_usable(const UncertainRigid3& pose) {
  return pose.mean.translation.allFinite() && pose.mean.rotation.coeffs().allFinite() &&
         pose.covariance.allFinite() && Eigen::LDLT<PoseCovariance>(pose.covariance).isPositive();
}

// Without the parts that are not numbers.
AutopilotSample usable_part(AutopilotSample sample) {
  const auto is_sigma = [](double sigma) { return sigma > 0 && std::isfinite(sigma); };
  auto& [time, attitude, velocity, rate, attitude_sigma, velocity_sigma, rate_sigma] = sample;
  // A quaternion far from length 1 is none; the wire's are off by its float's rounding.
  if (attitude && !(std::abs(attitude->norm() - 1) < 1e-2 && is_sigma(attitude_sigma))) attitude.reset();
  if (attitude) attitude->normalize();
  if (velocity && !(velocity->allFinite() && is_sigma(velocity_sigma))) velocity.reset();
  if (rate && !(rate->allFinite() && is_sigma(rate_sigma))) rate.reset();
  return sample;
}

// Events of one time have an order too, so that it does not matter in which they come: what the autopilot
// says before what the frame shows.
int rank(bool is_pose, const AutopilotSample& sample) {
  if (is_pose) return 8;
  return (sample.world_from_body ? 0 : 4) + (sample.body_velocity_in_world ? 0 : 2) +
         (sample.angular_velocity_in_body ? 0 : 1);
}

VehicleState state_of(const Motion& motion, int64_t timestamp_ns) {
  VehicleState state;
  state.timestamp_ns = timestamp_ns;
  state.pad_from_body = motion.pad_from_body;
  state.body_velocity_in_pad = motion.velocity;
  state.body_angular_velocity_in_pad = motion.angular_velocity;
  state.covariance = motion.P.topLeftCorner<12, 12>();
  state.source = StateSource::kPredicted;
  return state;
}

}  // namespace

void VehicleFilter::Heard::take(const AutopilotSample& sample) {
  if (sample.world_from_body) attitude = sample;
  if (sample.body_velocity_in_world) velocity = sample;
  if (sample.angular_velocity_in_body) angular_velocity = sample;
}

AutopilotSample VehicleFilter::Heard::at(int64_t timestamp_ns, double oldest) const {
  constexpr double kTurn = 0.5, kPush = 2, kTurnPush = 5;  // rad/s, m/s^2, rad/s^2: of a lively body
  const auto age = [&](const AutopilotSample& sample) {
    const bool is_old =
        timestamp_ns < sample.timestamp_ns || is_long_before(sample.timestamp_ns, timestamp_ns, oldest);
    return is_old ? INFINITY : seconds(sample.timestamp_ns, timestamp_ns);
  };
  AutopilotSample sample;
  sample.timestamp_ns = timestamp_ns;
  if (age(attitude) < INFINITY) sample.world_from_body = attitude.world_from_body;
  if (age(velocity) < INFINITY) sample.body_velocity_in_world = velocity.body_velocity_in_world;
  if (age(angular_velocity) < INFINITY)
    sample.angular_velocity_in_body = angular_velocity.angular_velocity_in_body;
  sample.attitude_sigma = attitude.attitude_sigma + kTurn * age(attitude);
  sample.velocity_sigma = velocity.velocity_sigma + kPush * age(velocity);
  sample.angular_velocity_sigma = angular_velocity.angular_velocity_sigma + kTurnPush * age(angular_velocity);
  return sample;
}

VehicleFilter::Known::Known(const TrackingOptions& options)
    : bank(body_hypotheses(options), pad_hypotheses(options)) {}

VehicleFilter::VehicleFilter(const TrackingOptions& options) : options_(options), base_(options) {}

// Also not at times before those that the history still has.
bool VehicleFilter::is_tracking(const Known& known, int64_t timestamp_ns) const {
  return known.tracking && known.timestamp_ns <= timestamp_ns &&
         !is_long_before(known.last_measured_ns, timestamp_ns, options_.coast);
}

VehicleFilter::Known VehicleFilter::after(const Known& before, const Event& event) const {
  Known known = before;
  known.believed = false;
  known.innovation_squared.reset();
  const bool tracking = is_tracking(before, event.timestamp_ns);
  if (tracking) {
    known.bank.propagate(seconds(before.timestamp_ns, event.timestamp_ns));
    known.timestamp_ns = event.timestamp_ns;
  }
  if (!event.pad_from_body) {
    known.heard.take(event.sample);
    if (tracking) known.bank.hear(event.sample, options_.gate, options_.restart_after);
    return known;
  }
  if (tracking) {
    known.innovation_squared = known.bank.surprise(*event.pad_from_body);
    known.believed = known.bank.see(*event.pad_from_body, options_.gate);
    known.refused = known.believed ? 0 : known.refused + 1;
  }
  if (!tracking || known.refused >= options_.restart_after) {
    known.bank.start(
        {*event.pad_from_body, options_.initial_velocity_sigma, options_.initial_angular_velocity_sigma});
    known.bank.hear(known.heard.at(event.timestamp_ns, options_.history), options_.gate,
                    options_.restart_after);
    known.tracking = known.believed = true;
    known.timestamp_ns = event.timestamp_ns;
    known.refused = 0;
  }
  if (known.believed) known.last_measured_ns = event.timestamp_ns;
  return known;
}

void VehicleFilter::insert(const Event& event) {
  const auto order = [](const Event& e) {
    return std::pair(e.timestamp_ns, rank(e.pad_from_body.has_value(), e.sample));
  };
  const auto place = std::lower_bound(history_.begin(), history_.end(), order(event),
                                      [&](const Entry& a, const auto& b) { return order(a.event) < b; });
  // The same once more: counted again, its noise would seem to average out.
  if (place != history_.end() && order(place->event) == order(event)) return;
  auto entry = history_.insert(place, Entry{event, base_});
  for (; entry != history_.end(); ++entry) {
    entry->after = after(entry == history_.begin() ? base_ : std::prev(entry)->after, entry->event);
  }
}

void VehicleFilter::forget_before(int64_t timestamp_ns) {
  while (!history_.empty() && history_.front().event.timestamp_ns < timestamp_ns) {
    base_ = std::move(history_.front().after);
    history_.pop_front();
  }
}

// After the last event up to then.
const VehicleFilter::Known& VehicleFilter::known_at(int64_t timestamp_ns) const {
  const auto next =
      std::upper_bound(history_.begin(), history_.end(), timestamp_ns,
                       [](int64_t time, const Entry& entry) { return time < entry.event.timestamp_ns; });
  return next == history_.begin() ? base_ : std::prev(next)->after;
}

std::optional<VehicleState> VehicleFilter::predict(int64_t timestamp_ns) const {
  const Known& known = known_at(timestamp_ns);
  if (!is_tracking(known, timestamp_ns)) return std::nullopt;
  return state_of(known.bank.predicted(seconds(known.timestamp_ns, timestamp_ns)), timestamp_ns);
}

std::optional<VehicleState> VehicleFilter::predict_widely(int64_t timestamp_ns) const {
  const Known& known = known_at(timestamp_ns);
  if (!is_tracking(known, timestamp_ns)) return std::nullopt;
  return state_of(known.bank.predicted_by_first(seconds(known.timestamp_ns, timestamp_ns)), timestamp_ns);
}

void VehicleFilter::hear(const AutopilotSample& sample) {
  constexpr double kAhead = 1.0;  // s: cameras stall and frames are worked on, but not for that long
  const int64_t t = sample.timestamp_ns;
  if (last_frame_ns_ &&
      (is_long_before(t, *last_frame_ns_, options_.history) || is_long_before(*last_frame_ns_, t, kAhead))) {
    return;
  }
  const AutopilotSample usable = usable_part(sample);
  if (!last_frame_ns_) {
    base_.heard.take(usable);
    return;
  }
  if (usable.world_from_body || usable.body_velocity_in_world || usable.angular_velocity_in_body) {
    insert({t, std::nullopt, usable});
  }
}

std::optional<VehicleState> VehicleFilter::update(int64_t timestamp_ns,
                                                  const std::optional<UncertainRigid3>& pad_from_body) {
  if (last_frame_ns_ && is_long_before(timestamp_ns, *last_frame_ns_, options_.history)) {
    history_.clear();
    base_ = Known(options_);
    last_frame_ns_.reset();
  }
  last_frame_ns_ = std::max(timestamp_ns, last_frame_ns_.value_or(timestamp_ns));
  if (pad_from_body && is_usable(*pad_from_body)) insert({timestamp_ns, pad_from_body, {}});
  if (const auto state = predict(timestamp_ns)) {
    last_state_ = state;
    const Known& known = known_at(timestamp_ns);
    if (known.timestamp_ns == timestamp_ns) last_state_->innovation_squared = known.innovation_squared;
    if (known.believed && known.timestamp_ns == timestamp_ns) last_state_->source = StateSource::kVision;
  } else if (last_state_) {
    last_state_->timestamp_ns = timestamp_ns;
    last_state_->innovation_squared.reset();
    last_state_->source = StateSource::kLost;
  }
  const auto history_ns = static_cast<int64_t>(options_.history * 1e9);
  if (*last_frame_ns_ > std::numeric_limits<int64_t>::min() + history_ns) {
    forget_before(*last_frame_ns_ - history_ns);
  }
  return last_state_;
}

}  // namespace perch
