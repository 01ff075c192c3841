#include "perch/links/mavlink/vehicle_link.h"

#include <algorithm>

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;

// Where only heartbeats come, at 1 Hz, three may be lost and the fourth a little late.
constexpr int64_t kLostAfter = 3'500 * kMs;
constexpr int64_t kHeartbeatPeriod = kSecond;
// The bytes of one frame follow each other; what has not come by then does not come.
constexpr int64_t kFrameWithin = 200 * kMs;
// A sample from this far ahead of its arrival, or behind it, has a wrong time, or is of no use any more:
// clocks are matched to some ms, and links that land aircraft take tens.
constexpr int64_t kAhead = 20 * kMs, kBehind = 300 * kMs;
constexpr int64_t kVersionPeriod = 2 * kSecond;
constexpr size_t kMaxTexts = 64;
// The middle of a longer exchange is off by up to 75 ms: at 1 rad/s more than any attitude is worth. At 9600
// baud it takes 90 ms.
constexpr int64_t kLongestExchange = 150 * kMs;
// Questions for the time that are never answered take the line from others.
constexpr uint64_t kTriesForTime = 5;

}  // namespace

VehicleLink::VehicleLink(const VehicleLinkOptions& options, Signing* signing)
    : options_(options),
      parser_(signing),
      writer_(options.system ? options.system : 1, options.component, signing) {
  if (options_.ask_each) requests_.want({{Heartbeat::kId, 1}});
}

void VehicleLink::receive(std::span<const uint8_t> bytes, int64_t arrival_ns, bool datagram) {
  const auto on_frame = [&](const Frame& frame) { handle(frame, arrival_ns); };
  last_arrival_ns_ = arrival_ns;
  if (datagram) {
    parser_.parse_datagram(bytes, on_frame);
  } else {
    parser_.parse(bytes, on_frame);
  }
}

std::vector<uint8_t> VehicleLink::tick(int64_t now_ns) {
  if (parser_.waiting() && now_ns - last_arrival_ns_ > kFrameWithin)
    parser_.give_up_waiting([&](const Frame& frame) { handle(frame, last_arrival_ns_); });
  if (state_ == LinkState::kUp && now_ns - last_heard_ns_ > kLostAfter) {
    state_ = LinkState::kLost;
    ++statistics_.times_lost;
  }
  if (!last_heartbeat_out_ns_ || now_ns - *last_heartbeat_out_ns_ >= kHeartbeatPeriod) {
    last_heartbeat_out_ns_ = now_ns;
    Heartbeat heartbeat;
    heartbeat.type = mav_type::kOnboardController;
    heartbeat.autopilot = mav_autopilot::kInvalid;
    heartbeat.system_status = kStateActive;
    heartbeat.mavlink_version = kMavlinkVersion;
    send(heartbeat);
  }
  if (options_.ask_each) ask_for_a_message(now_ns);
  if (state_ == LinkState::kUp) ask_for_things(now_ns);
  return std::exchange(out_, {});
}

void VehicleLink::ask_for_things(int64_t now_ns) {
  ask_for_time(now_ns);
  if (auto command = options_.ask_each ? std::nullopt : streams_.ask(now_ns)) {
    command->target_system = autopilot_.system;
    send(*command);
  }
  if (!options_.ask_each && !autopilot_.version && now_ns >= next_version_ns_) {
    next_version_ns_ = now_ns + kVersionPeriod;
    CommandLong command;
    command.command = mav_command::kRequestMessage;
    command.target_system = autopilot_.system;
    command.target_component = mav_component::kAutopilot;
    command.param1 = static_cast<float>(AutopilotVersion::kId);
    send(command);
  }
  if (const auto name = parameters_.ask(now_ns)) {
    ParamRequestRead request;
    request.param_index = -1;  // by name
    request.target_system = autopilot_.system;
    request.target_component = mav_component::kAutopilot;
    set_text(request.param_id, *name);
    send(request);
  }
}

void VehicleLink::ask_for_time(int64_t now_ns) {
  const auto& clock = clock_.statistics();
  if (options_.ask_each && clock.heard == 0 && clock.asked >= kTriesForTime) return;
  auto question = clock_.ask(now_ns);
  if (!question) return;
  question->target_system = autopilot_.system;
  question->target_component = mav_component::kAutopilot;
  send(*question);
}

void VehicleLink::ask_for_a_message(int64_t now_ns) {
  auto command = requests_.ask(now_ns);
  if (!command) return;
  // 0: whoever is there.
  command->target_system = state_ == LinkState::kSilent ? options_.system : autopilot_.system;
  send(*command);
}

void VehicleLink::handle(const Frame& frame, int64_t arrival_ns) {
  exchange_.reset();
  if (const auto heartbeat = decode<Heartbeat>(frame)) return handle_heartbeat(*heartbeat, frame, arrival_ns);
  if (state_ == LinkState::kSilent || frame.system != autopilot_.system) {
    ++statistics_.foreign;
    return;
  }
  if (on_frame_) on_frame_(frame);
  if (frame.id() == GimbalDeviceAttitudeStatus::kId) return handle_gimbal(frame, arrival_ns);
  // A rangefinder or a relay may have a component of its own; all else is the autopilot's to say.
  if (frame.component != mav_component::kAutopilot && frame.id() != DistanceSensor::kId) {
    ++statistics_.foreign;
    return;
  }
  streams_.heard(frame.id(), arrival_ns);
  if (frame.component == mav_component::kAutopilot && !comes_again(frame.sequence))
    exchange_ = requests_.heard(frame.id(), arrival_ns);
  // Any message is a sign of life: on a link that loses half of them four heartbeats in a row are soon lost.
  if (frame.component == mav_component::kAutopilot) last_heard_ns_ = arrival_ns;
  handle_of_autopilot(frame, arrival_ns);
}

// An autopilot is component 1 of a vehicle. Ground stations, gimbals, cameras and other companions say that
// they are no autopilot; the system 0 is no one's.
void VehicleLink::handle_heartbeat(const Heartbeat& heartbeat, const Frame& frame, int64_t arrival_ns) {
  const bool autopilot = frame.system != 0 && frame.component == mav_component::kAutopilot &&
                         heartbeat.autopilot != mav_autopilot::kInvalid && heartbeat.type != mav_type::kGcs;
  const uint8_t ours = state_ == LinkState::kSilent ? options_.system : autopilot_.system;
  if (!autopilot || (ours != 0 && frame.system != ours)) {
    ++statistics_.foreign;
    return;
  }
  ++statistics_.heartbeats;
  last_heard_ns_ = arrival_ns;
  requests_.heard(Heartbeat::kId, arrival_ns);
  if (state_ != LinkState::kUp) come_up(heartbeat, frame.system);
  streams_.heard(Heartbeat::kId, arrival_ns);
  autopilot_.type = heartbeat.type;
  autopilot_.base_mode = heartbeat.base_mode;
  autopilot_.custom_mode = heartbeat.custom_mode;
}

// Whatever was there before may have booted meanwhile: it is asked everything anew.
void VehicleLink::come_up(const Heartbeat& heartbeat, uint8_t system) {
  state_ = LinkState::kUp;
  ++statistics_.times_up;
  autopilot_ = {};
  autopilot_.system = system;
  autopilot_.autopilot = heartbeat.autopilot;
  writer_.set_system(system);
  streams_.want(wanted_streams());
  if (options_.ask_each) requests_.want(wanted_messages());
  parameters_.read(landing_parameters(heartbeat.autopilot));
  next_version_ns_ = 0;
}

std::vector<WantedStream> VehicleLink::wanted_streams() const {
  std::vector<WantedStream> streams = {
      {AttitudeQuaternion::kId, options_.attitude_hz},
      {LocalPositionNed::kId, options_.position_hz},
      {DistanceSensor::kId, 10},
      {ExtendedSysState::kId, 2},
      {SystemTime::kId, 1},
  };
  // ArduPilot does not send it; on PX4 it alone tells of resets.
  if (autopilot_.is_px4()) streams.push_back({Odometry::kId, options_.position_hz});
  // Only whether it comes matters: PX4 sends it while its global position is valid, and does not land on a
  // pad without.
  if (autopilot_.is_px4()) streams.push_back({GlobalPositionInt::kId, 1});
  if (options_.gimbal) streams.push_back({GimbalDeviceAttitudeStatus::kId, options_.gimbal_hz});
  return streams;
}

std::vector<WantedStream> VehicleLink::wanted_messages() const {
  return {{Attitude::kId, options_.attitude_hz},
          {LocalPositionNed::kId, options_.position_hz},
          {SystemTime::kId, 2},
          {Heartbeat::kId, 1},
          {AutopilotVersion::kId, 0.5}};
}

void VehicleLink::handle_of_autopilot(const Frame& frame, int64_t arrival_ns) {
  switch (frame.id()) {
    case Timesync::kId:
      return handle_timesync(*decode<Timesync>(frame), frame, arrival_ns);
    case AttitudeQuaternion::kId:
      return handle_sample<AttitudeQuaternion>(frame, arrival_ns);
    case Attitude::kId:
      return handle_sample<Attitude>(frame, arrival_ns);
    case LocalPositionNed::kId:
      return handle_sample<LocalPositionNed>(frame, arrival_ns);
    case Odometry::kId:
      return handle_sample<Odometry>(frame, arrival_ns);
    case DistanceSensor::kId:
      return handle_sample<DistanceSensor>(frame, arrival_ns);
    case ParamValue::kId:
      return parameters_.receive(*decode<ParamValue>(frame), autopilot_.autopilot);
    case CommandAck::kId:
      return handle_command_ack(*decode<CommandAck>(frame), arrival_ns);
    case AutopilotVersion::kId:
      autopilot_.version = decode<AutopilotVersion>(frame);
      requests_.drop(AutopilotVersion::kId);
      return;
    case ExtendedSysState::kId:
      autopilot_.landed_state = decode<ExtendedSysState>(frame)->landed_state;
      return;
    case SystemTime::kId:
      return handle_system_time(*decode<SystemTime>(frame), arrival_ns);
    case Statustext::kId:
      return handle_text(*decode<Statustext>(frame), arrival_ns);
    default:
      return;
  }
}

void VehicleLink::handle_timesync(const Timesync& message, const Frame& frame, int64_t arrival_ns) {
  // Old ArduPilots leave the targets out, which is 0: anyone.
  const bool to_us = (message.target_system == 0 || message.target_system == writer_.system()) &&
                     (message.target_component == 0 || message.target_component == writer_.component());
  if (!to_us) return;
  if (auto reply = clock_.receive(message, arrival_ns)) {
    reply->target_system = frame.system;
    reply->target_component = frame.component;
    send(*reply);
  }
  notice_clock_steps();
}

void VehicleLink::notice_clock_steps() {
  if (clock_.statistics().steps == clock_steps_) return;
  clock_steps_ = clock_.statistics().steps;
  // What is there was placed by a clock that has been set, or by one that booted.
  history_.clear();
  unix_minus_monotonic_ns_.reset();
}

// SYSTEM_TIME's time is that of the answer, as TIMESYNC's, but cut to whole ms. (An attitude's is that of the
// last time it was computed, which may be long before the question.)
void VehicleLink::take_clock_of(const SystemTime& message) {
  if (!exchange_ || message.time_boot_ms == 0 || message.time_boot_ms == last_boot_ms_) return;
  last_boot_ms_ = message.time_boot_ms;
  const int64_t remote_ns = message.time_boot_ms * kMs + kMs / 2;
  clock_.exchange(exchange_->sent_ns - kMs / 2, exchange_->arrival_ns + kMs / 2, remote_ns);
  notice_clock_steps();
}

// A datagram that the network delivers twice has a number from before; as the answer to a newer question it
// would be of a wrong time. An autopilot that has booted begins at 0, and some never count: after eight in a
// row it is that.
bool VehicleLink::comes_again(uint8_t sequence) {
  constexpr uint8_t kRecent = 64;
  const bool recent = last_sequence_ && static_cast<uint8_t>(*last_sequence_ - sequence) < kRecent;
  recent_in_a_row_ = recent ? recent_in_a_row_ + 1 : 0;
  if (recent && recent_in_a_row_ < 8) return true;
  last_sequence_ = sequence;
  return false;
}

std::optional<int64_t> VehicleLink::halfway() const {
  if (!exchange_ || exchange_->round_trip_ns() > kLongestExchange) return std::nullopt;
  return exchange_->sent_ns + exchange_->round_trip_ns() / 2;
}

std::optional<int64_t> VehicleLink::plausible(std::optional<int64_t> time_ns, int64_t arrival_ns,
                                              bool stamped) {
  const bool unknown = !time_ns || clock_.doubtful();
  if (!unknown && *time_ns <= arrival_ns + kAhead && *time_ns >= arrival_ns - kBehind) return time_ns;
  // One that a clock we know says is old is old, however quickly it came.
  const auto middle_ns = unknown || !stamped ? halfway() : std::nullopt;
  if (middle_ns) {
    ++statistics_.times_by_round_trip;
    return middle_ns;
  }
  ++(unknown ? statistics_.times_unknown : statistics_.times_implausible);
  return std::nullopt;
}

template <class Message>
void VehicleLink::handle_sample(const Frame& frame, int64_t arrival_ns) {
  const Message message = *decode<Message>(frame);
  std::optional<int64_t> time_ns;
  bool stamped = true;
  if constexpr (requires { message.time_boot_ms; }) {
    stamped = message.time_boot_ms != 0;
    // An autopilot that is asked, and answers with what it said before, has nothing new.
    uint32_t& last = last_stamps_[frame.id()];
    if (options_.ask_each && stamped && message.time_boot_ms == last) {
      ++statistics_.times_implausible;
      return;
    }
    last = message.time_boot_ms;
  }
  if (frame.component != mav_component::kAutopilot) {
    time_ns = arrival_ns;  // it has a clock of its own, which is not matched
  } else if constexpr (requires { message.time_boot_ms; }) {
    time_ns = clock_.local_from_boot_ms(message.time_boot_ms, arrival_ns);
  } else {
    constexpr uint64_t kMost = uint64_t{INT64_MAX} / 1000;
    time_ns =
        clock_.local_from_remote(static_cast<int64_t>(std::min(message.time_usec, kMost) * 1000), arrival_ns);
  }
  time_ns = plausible(time_ns, arrival_ns, stamped);
  if (time_ns && !history_.add(message, *time_ns)) ++statistics_.samples_refused;
}

void VehicleLink::handle_gimbal(const Frame& frame, int64_t arrival_ns) {
  const auto message = *decode<GimbalDeviceAttitudeStatus>(frame);
  streams_.heard(frame.id(), arrival_ns);
  // The request goes to whoever sends it: the gimbal itself, or the autopilot for it.
  streams_.set_component(frame.id(), frame.component);
  // A gimbal's stamps are of its own clock. Often it was switched on with the autopilot, and its time would
  // look right while it is a second off: its samples are as old as they are on arrival.
  const bool own_clock = frame.component != mav_component::kAutopilot;
  const auto time_ns = plausible(
      own_clock ? arrival_ns : clock_.local_from_boot_ms(message.time_boot_ms, arrival_ns), arrival_ns);
  if (time_ns && !history_.add(message, frame.component, *time_ns)) ++statistics_.samples_refused;
}

void VehicleLink::handle_command_ack(const CommandAck& ack, int64_t arrival_ns) {
  const bool to_us = (ack.target_system == 0 || ack.target_system == writer_.system()) &&
                     (ack.target_component == 0 || ack.target_component == writer_.component());
  if (to_us && ack.command == mav_command::kSetMessageInterval) streams_.acknowledged(ack.result, arrival_ns);
  if (to_us && ack.command == mav_command::kRequestMessage) requests_.acknowledged(ack.result, arrival_ns);
}

void VehicleLink::handle_system_time(const SystemTime& message, int64_t arrival_ns) {
  if (options_.ask_each) take_clock_of(message);
  // Before it has the time from satellites it counts from 0, or from when its firmware was made.
  constexpr uint64_t k2020_us = 1'577'836'800ULL * 1'000'000, k2100_us = 4'102'444'800ULL * 1'000'000;
  if (message.time_unix_usec < k2020_us || message.time_unix_usec > k2100_us) return;
  const auto time_ns = plausible(clock_.local_from_boot_ms(message.time_boot_ms, arrival_ns), arrival_ns);
  if (time_ns) unix_minus_monotonic_ns_ = static_cast<int64_t>(message.time_unix_usec) * 1000 - *time_ns;
}

void VehicleLink::handle_text(const Statustext& message, int64_t arrival_ns) {
  if (texts_.size() >= kMaxTexts) texts_.pop_front();
  texts_.push_back({arrival_ns, message.severity, printable(text_of(message.text))});
}

std::vector<VehicleText> VehicleLink::take_texts() {
  std::vector<VehicleText> texts(texts_.begin(), texts_.end());
  texts_.clear();
  return texts;
}

std::string version_text(const AutopilotVersion& version) {
  const auto part = [&](int byte) {
    return std::to_string((version.flight_sw_version >> (8 * byte)) & 0xFF);
  };
  return part(3) + "." + part(2) + "." + part(1);
}

std::string printable(std::string_view text) {
  std::string clean(text);
  for (char& c : clean) {
    if (c < ' ' || c > '~') c = '?';
  }
  return clean;
}

}  // namespace perch::mavlink
