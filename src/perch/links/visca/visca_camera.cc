#include "perch/links/visca/visca_camera.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "perch/links/visca/ip_framing.h"

namespace perch::visca {
namespace {

constexpr int64_t kMs = 1'000'000;
// What is not there by then does not come: an inquiry and its answer take 17 ms at 9600 baud, the device a
// picture or two (33 ms each).
constexpr int64_t kAnswerWithin = 100 * kMs;
// A chain of seven cameras passes its addresses on one after the other.
constexpr int64_t kAddressWithin = 300 * kMs;
// Two thirds of the line stay for inquiries.
constexpr int64_t kBetweenCommands = 60 * kMs;
// On a line that garbles only the reports between two commands can be trusted: there are to be some.
constexpr int64_t kBetweenCommandsGarbled = 240 * kMs;
// A drive that goes on is said again now and then: a byte on the way may have made another of it.
constexpr int64_t kSayAgain = 500 * kMs;
// Somebody may zoom: so long a picture may be taken for one of another lens.
constexpr int64_t kBetweenZooms = 400 * kMs;
// So long before the device looks a question is to be there: what the clocks of this machine waver by.
constexpr double kJustBefore = 0.003;  // s
// Longer than a field of video (PAL: 20 ms) no pause is of use; nor is one to a device that looks at any
// time.
constexpr double kLongestPause = 0.021;  // s
constexpr int64_t kUselessFor = 10'000 * kMs;
constexpr int64_t kBufferFullPause = 50 * kMs;
// The longest way at the lowest speed that is asked for, and a completion that was lost.
constexpr int64_t kSocketFor = 5000 * kMs;
// The bytes of a packet follow each other.
constexpr int64_t kSilence = 50 * kMs;
constexpr int kMostFailures = 5;
constexpr int kMostTries = 3;
// Two readings of the zoom that agree to a hundredth.
constexpr double kZoomAgrees = 0.01;

double seconds(int64_t ns) { return static_cast<double>(ns) * 1e-9; }
int64_t nanoseconds(double s) { return std::llround(s * 1e9); }

int16_t counts_of(double angle, const AxisLimits& axis) {
  return static_cast<int16_t>(std::lround(std::clamp(angle, axis.min, axis.max) / axis.count));
}

int16_t relative_counts(double angle, const AxisLimits& axis) {
  const double most = axis.max - axis.min;
  return static_cast<int16_t>(std::lround(std::clamp(angle, -most, most) / axis.count));
}

int steps(double speed, const AxisLimits& axis) {
  return static_cast<int>(std::lround(std::clamp(speed, -axis.max_speed, axis.max_speed) / axis.speed_step));
}

}  // namespace

ViscaCamera::ViscaCamera(const ViscaOptions& options) : options_(options), track_(options.head) {
  start(State::kAddress);
}

double ViscaCamera::on_wire(size_t bytes) const {
  return options_.over_ip ? 0 : static_cast<double>(bytes) * 10 / options_.baud;
}

// What the device held is cleared by IF_Clear, and what it does now is not known.
void ViscaCamera::start(State state) {
  state_ = options_.over_ip ? State::kClear : state;
  reset_sequence_ = options_.over_ip;
  ++statistics_.starts;
  waiting_.reset();
  sockets_ = {};
  driving_.reset();
  zoom_.reset();
  zoom_suspect_.reset();
  failures_ = 0;
}

std::optional<HeadAngles> ViscaCamera::at(int64_t time_ns) const {
  return garbles() ? track_.confirmed_at(time_ns) : track_.at(time_ns);
}

void ViscaCamera::point(const HeadGoal& goal) {
  if (!std::isfinite(goal.pan) || !std::isfinite(goal.tilt)) return;
  if (!says_anything(goal)) return goal_.reset();
  if (!goal_) goal_tries_ = 0;
  goal_ = goal;
}

void ViscaCamera::zoom_to(double zoom) {
  zooms_retold_ = 0;
  if (std::isfinite(zoom)) zoom_told_ = zoom_goal_ = std::clamp(zoom, 0.0, 1.0);
}

DriveSteps ViscaCamera::steps_of(const HeadGoal& goal) const {
  return {steps(goal.pan, options_.head.pan), steps(goal.tilt, options_.head.tilt)};
}

// A drive that the device is at already says nothing.
bool ViscaCamera::says_anything(const HeadGoal& goal) const {
  if (goal.kind != HeadGoal::Kind::kDrive || !driving_) return true;
  if (steps_of(goal) != *driving_) return true;
  return last_byte_ns_ - driving_since_ns_ > kSayAgain;
}

void ViscaCamera::receive(std::span<const uint8_t> bytes, int64_t arrival_ns, bool datagram) {
  if (parser_.waiting() && (datagram || arrival_ns - last_byte_ns_ > kSilence)) parser_.drop();
  last_byte_ns_ = std::max(last_byte_ns_, arrival_ns);
  std::optional<uint32_t> sequence;
  if (options_.over_ip) {
    const auto message = read_ip_datagram(bytes);
    if (!message) return ++statistics_.garbled, void();
    if (is_ip_error(*message)) return start(State::kClear);
    if (message->type != IpType::kReply) return;
    sequence = message->sequence;
    bytes = message->payload;
  }
  parser_.parse(bytes, [&](std::span<const uint8_t> packet) { handle(packet, sequence, arrival_ns); });
}

void ViscaCamera::handle(std::span<const uint8_t> packet, std::optional<uint32_t> sequence,
                         int64_t arrival_ns) {
  const auto reply = read_reply(packet);
  if (!reply || (reply->camera != 0 && reply->camera != options_.camera)) {
    ++statistics_.garbled;
    line_garbles();
    return;
  }
  switch (reply->kind) {
    case ReplyKind::kNetworkChange:
      return start(State::kAddress);
    case ReplyKind::kAddressSet:
      if (!waiting_ || waiting_->what != Ask::kAddress) return;
      waiting_.reset();
      if (reply->payload[0] > options_.camera) state_ = State::kClear;
      return;
    case ReplyKind::kBroadcastClear:
      return;
    case ReplyKind::kCompletion:
      ++statistics_.completions;
      if (reply->socket < sockets_.size()) sockets_[reply->socket] = {};
      return;
    case ReplyKind::kAck:
    case ReplyKind::kAnswer:
      // What comes sooner than its bytes could, or bears another number, answers something older.
      if (!waiting_ || (sequence && *sequence != waiting_->sequence) ||
          seconds(arrival_ns - waiting_->sent_ns) < 0.9 * (waiting_->bits + on_wire(packet.size()))) {
        ++statistics_.garbled;
        line_garbles();
        return;
      }
      return reply->kind == ReplyKind::kAck ? handle_ack(*reply, arrival_ns)
                                            : handle_answer(*reply, arrival_ns);
    case ReplyKind::kError:
      if (sequence && waiting_ && reply->socket == 0 && *sequence != waiting_->sequence) return;
      return handle_error(*reply);
  }
}

void ViscaCamera::handle_answer(const Reply& reply, int64_t arrival_ns) {
  const Ask what = waiting_->what;
  const auto pan_tilt = what == Ask::kPanTilt ? read_pan_tilt(reply.payload) : std::nullopt;
  const auto zoom = what == Ask::kZoom ? read_zoom(reply.payload) : std::nullopt;
  const bool clear = what == Ask::kClear && reply.payload.empty();
  if (!pan_tilt && !zoom && !clear) {
    ++statistics_.garbled;
    line_garbles();
    return failed();
  }
  if (clear) state_ = State::kReady;
  if (pan_tilt) take_position(reply.payload, arrival_ns);
  if (zoom) take_zoom(reply.payload);
  answered(arrival_ns);
}

void ViscaCamera::answered(int64_t arrival_ns) {
  answered_ = waiting_->what;
  answered_ns_ = arrival_ns;
  waiting_.reset();
  failures_ = restarts_ = 0;
}

// A question that came too late waits for the next look: it took longer by a field.
void ViscaCamera::learn_pause(double took, int64_t arrival_ns) {
  Pause& pause = pauses_[static_cast<size_t>(answered_)];
  const bool missed = pause.length > 0 && took > pause.took + 2 * kJustBefore;
  pause.took = took;
  if (arrival_ns < pause.useless_until_ns) return;
  pause.length = std::max(0.0, pause.length + (missed ? -kJustBefore : took - kJustBefore) / 2);
  if (pause.length > kLongestPause) pause = {0, took, arrival_ns + kUselessFor};
}

// The device looked at its angles at some moment after the question was there and before the answer left.
void ViscaCamera::take_position(std::span<const uint8_t> payload, int64_t arrival_ns) {
  ++statistics_.positions;
  const PanTiltCounts counts = *read_pan_tilt(payload);
  const double answer = on_wire(3 + payload.size());
  const int64_t from_ns = waiting_->sent_ns + nanoseconds(waiting_->bits);
  const int64_t to_ns = std::max(from_ns, arrival_ns - nanoseconds(answer));
  const double took = seconds(to_ns - from_ns);
  reaction_ += reaction_ == 0 ? took : (took - reaction_) / 16;
  learn_pause(took, arrival_ns);
  const auto verdict =
      track_.add(from_ns + (to_ns - from_ns) / 2, took / std::sqrt(12.0),
                 counts.pan * options_.head.pan.count, counts.tilt * options_.head.tilt.count);
  if (verdict == HeadTrack::Verdict::kUsed) return;
  ++(verdict == HeadTrack::Verdict::kWaits ? statistics_.positions_doubted : statistics_.positions_refused);
  driving_.reset();  // it may have been told otherwise than we think: say it again
}

void ViscaCamera::take_zoom(std::span<const uint8_t> payload) {
  const double zoom = static_cast<double>(*read_zoom(payload)) / options_.zoom_counts;
  if (zoom > 1 + kZoomAgrees) return;
  const bool agrees = zoom_suspect_ && std::abs(*zoom_suspect_ - zoom) < kZoomAgrees;
  zoom_suspect_ = zoom;
  if (agrees) zoom_ = zoom;
  // It stands elsewhere than it was told to: its command was lost, or cancelled for another's sake.
  // Told so often in vain it cannot, or somebody else zooms.
  constexpr int kMostRetold = 3;
  if (agrees && zoom_told_ && !zoom_goal_ && zooms_retold_ < kMostRetold &&
      std::abs(*zoom_told_ - zoom) >= kZoomAgrees) {
    zoom_goal_ = zoom_told_;
    ++zooms_retold_;
  }
  // Somebody zooms, or the line garbled: nobody knows until two agree again.
  if (zoom_ && std::abs(*zoom_ - zoom) >= kZoomAgrees) zoom_.reset();
}

void ViscaCamera::handle_ack(const Reply& reply, int64_t arrival_ns) {
  const bool command = waiting_->what == Ask::kMove || waiting_->what == Ask::kZoomMove;
  if (!command || reply.socket == 0 || reply.socket >= sockets_.size()) {
    ++statistics_.garbled;
    return failed();
  }
  ++statistics_.acks;
  const int64_t begun_ns = arrival_ns - nanoseconds(on_wire(3));
  sockets_[reply.socket] = {true, waiting_->what == Ask::kMove, begun_ns};
  if (waiting_->what == Ask::kMove) {
    HeadGoal goal = waiting_->goal;
    driving_.reset();
    if (goal.kind == HeadGoal::Kind::kDrive) {
      driving_ = steps_of(goal);
      driving_since_ns_ = begun_ns;
      goal.pan = driving_->pan * options_.head.pan.speed_step;
      goal.tilt = driving_->tilt * options_.head.tilt.speed_step;
    }
    track_.moves(begun_ns + nanoseconds(options_.motor_delay), goal);
  }
  answered(arrival_ns);
}

void ViscaCamera::handle_error(const Reply& reply) {
  ++statistics_.errors;
  const auto code = static_cast<ErrorCode>(reply.error);
  if (code == ErrorCode::kCancelled || code == ErrorCode::kNoSocket) {
    if (reply.socket < sockets_.size()) sockets_[reply.socket] = {};
    if (waiting_ && waiting_->what == Ask::kCancel) waiting_.reset();
    return;
  }
  if (!waiting_) return;
  if (code == ErrorCode::kBufferFull) {
    hold_until_ns_ = last_byte_ns_ + kBufferFullPause;
    again(*waiting_);
    waiting_.reset();
  } else if (code == ErrorCode::kNotExecutable) {
    if (reply.socket != 0 && reply.socket < sockets_.size()) sockets_[reply.socket] = {};
    waiting_.reset();
  } else {
    line_garbles();  // on its way there
    failed();
  }
}

// A command that did not get there is sent again, unless a newer one takes its place.
void ViscaCamera::again(const Waiting& waiting) {
  if (waiting.what == Ask::kMove && !goal_ && ++goal_tries_ < kMostTries) goal_ = waiting.goal;
  if (waiting.what == Ask::kZoomMove && !zoom_goal_) zoom_goal_ = waiting.zoom;
}

void ViscaCamera::failed() {
  const Waiting waiting = *waiting_;
  waiting_.reset();
  if (waiting.what == Ask::kMove) {  // taken or not: nobody knows
    driving_.reset();
    track_.may_move(waiting.sent_ns, last_tick_ns_ + nanoseconds(options_.motor_delay));
  }
  again(waiting);
  if (++failures_ < kMostFailures) return;
  // First what the device holds may be in disorder, then who it thinks it is.
  start(restarts_++ == 0 ? State::kClear : State::kAddress);
}

int ViscaCamera::free_socket() const {
  for (int i = 1; i < static_cast<int>(sockets_.size()); ++i) {
    if (!sockets_[static_cast<size_t>(i)].busy) return i;
  }
  return 0;
}

std::optional<ViscaCamera::Waiting> ViscaCamera::next(int64_t now_ns) {
  if (state_ == State::kAddress) return Waiting{Ask::kAddress};
  if (state_ == State::kClear) return Waiting{Ask::kClear};
  // What does not move as it was told is told again at once.
  const int64_t between = garbles() && driving_ ? kBetweenCommandsGarbled : kBetweenCommands;
  const bool may_command = now_ns >= hold_until_ns_ && now_ns - last_command_ns_ >= between;
  if (may_command && (goal_ || zoom_goal_)) {
    last_command_ns_ = now_ns;
    if (!free_socket()) return Waiting{Ask::kCancel};
    // The zoom is told seldom, a movement with each picture.
    Waiting waiting{zoom_goal_ ? Ask::kZoomMove : Ask::kMove};
    if (zoom_goal_) {
      waiting.zoom = *std::exchange(zoom_goal_, std::nullopt);
      zoom_.reset();  // until it is found standing still
      zoom_suspect_.reset();
    } else {
      waiting.goal = *std::exchange(goal_, std::nullopt);
    }
    ++statistics_.commands;
    return waiting;
  }
  if (now_ns - answered_ns_ < nanoseconds(pauses_[static_cast<size_t>(answered_)].length))
    return std::nullopt;
  ++statistics_.inquiries;
  if (now_ns - last_zoom_ns_ > (zoom_ ? kBetweenZooms : kBetweenZooms / 4)) {
    last_zoom_ns_ = now_ns;
    return Waiting{Ask::kZoom};
  }
  return Waiting{Ask::kPanTilt};
}

Bytes ViscaCamera::packet_of(const Waiting& waiting) const {
  const uint8_t camera = options_.camera;
  const HeadModel& head = options_.head;
  const SpeedSteps speed{static_cast<uint8_t>(steps(head.pan.max_speed, head.pan)),
                         static_cast<uint8_t>(steps(head.tilt.max_speed, head.tilt))};
  const HeadGoal& goal = waiting.goal;
  switch (waiting.what) {
    case Ask::kAddress:
      return address_set();
    case Ask::kClear:
      return if_clear(camera);
    case Ask::kPanTilt:
      return pan_tilt_inquiry(camera);
    case Ask::kZoom:
      return zoom_inquiry(camera);
    case Ask::kZoomMove:
      return zoom_direct(camera, static_cast<uint16_t>(std::lround(waiting.zoom * options_.zoom_counts)));
    case Ask::kCancel:
      return cancel(camera, sockets_[1].since_ns <= sockets_[2].since_ns ? 1 : 2);
    case Ask::kMove:
      break;
  }
  switch (goal.kind) {
    case HeadGoal::Kind::kAbsolute:
      return pan_tilt_absolute(camera, speed,
                               {counts_of(goal.pan, head.pan), counts_of(goal.tilt, head.tilt)});
    case HeadGoal::Kind::kRelative:
      return pan_tilt_relative(camera, speed,
                               {relative_counts(goal.pan, head.pan), relative_counts(goal.tilt, head.tilt)});
    case HeadGoal::Kind::kDrive:
      break;
  }
  return pan_tilt_drive(camera, steps_of(goal));
}

std::vector<Bytes> ViscaCamera::tick(int64_t now_ns) {
  last_tick_ns_ = now_ns;
  for (Socket& socket : sockets_) {
    if (socket.busy && now_ns - socket.since_ns > kSocketFor) socket = {};
  }
  if (waiting_) {
    const int64_t within = waiting_->what == Ask::kAddress ? kAddressWithin : kAnswerWithin;
    if (now_ns - waiting_->sent_ns <= within) return {};
    ++statistics_.time_outs;
    line_garbles();
    parser_.drop();
    failed();
  }
  auto waiting = next(now_ns);
  if (!waiting) return {};
  std::vector<Bytes> packets;
  Bytes packet = packet_of(*waiting);
  waiting->sent_ns = now_ns;
  waiting->bits = on_wire(packet.size());
  if (options_.over_ip) {
    if (std::exchange(reset_sequence_, false)) {
      packets.push_back(ip_reset_sequence());
      sequence_ = 0;
    }
    waiting->sequence = sequence_++;
    packet = ip_datagram(ip_type_of(packet), waiting->sequence, packet);
  }
  waiting_ = *waiting;
  // After a failure the device may sit on half a packet, to which this one would be the rest.
  if (failures_ > 0 && !options_.over_ip) {
    packets.push_back({kEnd});
    waiting_->bits += on_wire(1);
  }
  packets.push_back(std::move(packet));
  return packets;
}

}  // namespace perch::visca
