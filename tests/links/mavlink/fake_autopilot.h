#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "perch/geometry/euler.h"
#include "perch/geometry/rigid3.h"
#include "perch/links/mavlink/frame.h"
#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/numbers.h"
#include "perch/links/mavlink/parser.h"
#include "perch/links/mavlink/vehicle_link.h"
#include "support/rng.h"

namespace perch::mavlink {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;

// Where the vehicle of a test is, by our clock.
struct TrueMotion {
  Rigid3 ned_from_body;
  Eigen::Vector3d body_rate = Eigen::Vector3d::Zero();             // rad/s, body axes
  Eigen::Vector3d body_velocity_in_ned = Eigen::Vector3d::Zero();  // m/s
};

// An autopilot on a simulated clock: it has booted some time ago, its clock drifts, its messages take their
// time.
class FakeAutopilot {
 public:
  explicit FakeAutopilot(unsigned seed = 0, Signing* signing = nullptr)
      : rng(seed), parser_(signing), writer_(1, 1, signing) {}

  // ---- What the test sets.
  TestRng rng;
  uint8_t autopilot = mav_autopilot::kArdupilot;
  int64_t booted_ns = -500 * kSecond;  // on our clock
  double skew = 50e-6;
  double delay_ms = 2, jitter_ms = 2;  // exponential, of each message on its own; their order is kept
  double loss = 0;                     // both ways
  bool silent = false;
  bool datagrams = true;          // else what it hears is a stream, cut anywhere
  bool only_answers = false;      // nothing by itself, no heartbeat either, and no streams
  bool stamps = true;             // else every time_boot_ms is 0
  std::set<uint32_t> unanswered;  // questions for these are not heard
  double late = 0;                // this share of the messages, and all behind them, wait for 0.4 s
  double twice = 0;               // this share comes twice, the second time up to 0.2 s later
  int deaf_requests = 0;          // so many intervals asked for are ignored
  std::map<std::string, double> parameters = {{"PLND_ENABLED", 1}, {"PLND_TYPE", 1}, {"PLND_LAG", 0.0625}};
  std::set<uint32_t> unsupported;
  std::function<TrueMotion(int64_t)> motion = [](int64_t) { return TrueMotion{}; };
  std::function<GimbalDeviceAttitudeStatus(int64_t)> gimbal;  // where it looks; without: there is none
  std::function<void(const Frame&, int64_t)> on_frame;        // hears what it hears

  // ---- What the test looks at.
  std::map<uint32_t, int> heard;      // messages of ours, by id
  std::map<uint32_t, int> requests;   // of single messages
  std::map<uint32_t, int> intervals;  // requests for each message's interval
  std::vector<LandingTarget> landing_targets;
  std::vector<Statustext> texts;
  std::optional<Timesync> answer;  // the last to a question of the autopilot's
  std::set<std::pair<uint8_t, uint8_t>> speakers;

  int64_t boot_time_ns(int64_t now_ns) const {
    return std::llround(static_cast<double>(now_ns - booted_ns) * (1 + skew));
  }

  void receive(std::span<const uint8_t> bytes, int64_t now_ns) {
    if (bytes.empty() || silent || rng.uniform(0, 1) < loss) return;
    incoming_.push_back({now_ns + delay(), {bytes.begin(), bytes.end()}});
  }

  // Does what it does at this moment, and hands over what arrives at our side.
  void step(int64_t now_ns, VehicleLink& link) {
    step(now_ns,
         [&](const std::vector<uint8_t>& bytes, int64_t due_ns) { link.receive(bytes, due_ns, true); });
  }
  template <class HandOver>
  void step(int64_t now_ns, const HandOver& hand_over) {
    while (!incoming_.empty() && incoming_.front().due_ns <= now_ns) {
      const auto hear = [&](const Frame& frame) { handle(frame, now_ns); };
      const auto& bytes = incoming_.front().bytes;
      datagrams ? parser_.parse_datagram(bytes, hear) : parser_.parse(bytes, hear);
      incoming_.pop_front();
    }
    if (!silent && !only_answers) {
      if (due(Heartbeat::kId, 1, now_ns)) send_heartbeat(now_ns);
      for (const auto& [id, hz] : streams_) {
        if (due(id, hz, now_ns)) send_stream(id, now_ns);
      }
    }
    while (!outgoing_.empty() && outgoing_.front().due_ns <= now_ns) {
      hand_over(outgoing_.front().bytes, outgoing_.front().due_ns);
      outgoing_.pop_front();
    }
  }

  template <class Message>
  void send(const Message& message, int64_t now_ns) {
    std::vector<uint8_t> bytes;
    writer_.append(bytes, message);
    if (rng.uniform(0, 1) < loss) return;
    int64_t due = now_ns + delay();
    if (late > 0 && rng.uniform(0, 1) < late) due += 400 * kMs;
    if (!outgoing_.empty()) due = std::max(due, outgoing_.back().due_ns);
    outgoing_.push_back({due, bytes});
    if (twice > 0 && rng.uniform(0, 1) < twice) {
      const Packet again{due + static_cast<int64_t>(rng.uniform(0, 200e6)), bytes};
      const auto place =
          std::upper_bound(outgoing_.begin(), outgoing_.end(), again,
                           [](const Packet& a, const Packet& b) { return a.due_ns < b.due_ns; });
      outgoing_.insert(place, again);
    }
  }

  void reboot(int64_t now_ns) {
    booted_ns = now_ns;
    streams_.clear();
  }

 private:
  struct Packet {
    int64_t due_ns;
    std::vector<uint8_t> bytes;
  };

  int64_t delay() {
    return static_cast<int64_t>((delay_ms - jitter_ms * std::log(1 - rng.uniform(0, 1))) * 1e6);
  }

  bool due(uint32_t id, double hz, int64_t now_ns) {
    int64_t& last = last_sent_[id];
    if (last != 0 && static_cast<double>(now_ns - last) < 1e9 / hz - 0.5e6) return false;
    last = now_ns;
    return true;
  }

  void send_heartbeat(int64_t now_ns) {
    Heartbeat heartbeat;
    heartbeat.type = 2;
    heartbeat.autopilot = autopilot;
    heartbeat.base_mode = 209;
    heartbeat.mavlink_version = 3;
    send(heartbeat, now_ns);
  }

  void send_stream(uint32_t id, int64_t now_ns) {
    const TrueMotion truth = motion(now_ns);
    const auto boot_ms = stamps ? static_cast<uint32_t>(boot_time_ns(now_ns) / kMs) : 0u;
    const Eigen::Quaternionf q = truth.ned_from_body.rotation.cast<float>();
    const Eigen::Vector3f p = truth.ned_from_body.translation.cast<float>(),
                          w = truth.body_rate.cast<float>(), v = truth.body_velocity_in_ned.cast<float>();
    if (id == AttitudeQuaternion::kId) {
      send(AttitudeQuaternion{boot_ms, q.w(), q.x(), q.y(), q.z(), w.x(), w.y(), w.z(), {}}, now_ns);
    } else if (id == Attitude::kId) {
      const YawPitchRoll a = ypr_from_rotation(truth.ned_from_body.rotation);
      send(Attitude{boot_ms, static_cast<float>(a.roll), static_cast<float>(a.pitch),
                    static_cast<float>(a.yaw), w.x(), w.y(), w.z()},
           now_ns);
    } else if (id == LocalPositionNed::kId) {
      send(LocalPositionNed{boot_ms, p.x(), p.y(), p.z(), v.x(), v.y(), v.z()}, now_ns);
    } else if (id == Odometry::kId) {
      Odometry odometry;
      odometry.time_usec = static_cast<uint64_t>(boot_time_ns(now_ns) / 1000);
      odometry.x = p.x(), odometry.y = p.y(), odometry.z = p.z();
      odometry.q = {q.w(), q.x(), q.y(), q.z()};
      odometry.vx = v.x(), odometry.vy = v.y(), odometry.vz = v.z();
      odometry.rollspeed = w.x(), odometry.pitchspeed = w.y(), odometry.yawspeed = w.z();
      odometry.frame_id = odometry.child_frame_id = mav_frame::kLocalNed;
      send(odometry, now_ns);
    } else if (id == SystemTime::kId) {
      send(SystemTime{1'800'000'000'000'000ULL + static_cast<uint64_t>(now_ns / 1000), boot_ms}, now_ns);
    } else if (id == ExtendedSysState::kId) {
      send(ExtendedSysState{0, kLandedStateOnGround}, now_ns);
    } else if (id == DistanceSensor::kId) {
      DistanceSensor sensor;
      sensor.time_boot_ms = boot_ms;
      sensor.min_distance = 20, sensor.max_distance = 4000;
      sensor.current_distance = static_cast<uint16_t>(std::max(0.0f, -100 * p.z()));
      sensor.orientation = kOrientationDown;
      send(sensor, now_ns);
    } else if (id == GimbalDeviceAttitudeStatus::kId && gimbal) {
      GimbalDeviceAttitudeStatus status = gimbal(now_ns);
      status.time_boot_ms = boot_ms;
      send(status, now_ns);
    }
  }

  void handle(const Frame& frame, int64_t now_ns) {
    ++heard[frame.id()];
    if (on_frame) on_frame(frame, now_ns);
    speakers.insert({frame.system, frame.component});
    if (const auto m = decode<LandingTarget>(frame)) landing_targets.push_back(*m);
    if (const auto m = decode<Statustext>(frame)) texts.push_back(*m);
    if (const auto m = decode<CommandLong>(frame)) handle_command(*m, now_ns);
    if (const auto m = decode<ParamRequestRead>(frame)) handle_parameter(text_of(m->param_id), now_ns);
    if (const auto m = decode<Timesync>(frame); m && !unanswered.count(Timesync::kId)) {
      if (m->tc1 != 0) {
        answer = *m;
      } else {
        send(Timesync{boot_time_ns(now_ns), m->ts1, frame.system, frame.component}, now_ns);
      }
    }
  }

  void handle_command(const CommandLong& command, int64_t now_ns) {
    const auto id = static_cast<uint32_t>(command.param1);
    CommandAck ack;
    ack.command = command.command;
    if (command.command == mav_command::kRequestMessage) {
      ++requests[id];
      if (unanswered.count(id)) return;
      if (unsupported.count(id)) ack.result = mav_result::kUnsupported;
      send(ack, now_ns);
      if (unsupported.count(id)) return;
      if (id == AutopilotVersion::kId) {
        AutopilotVersion version;
        version.flight_sw_version = 0x04060000;
        send(version, now_ns);
      } else if (id == Heartbeat::kId) {
        send_heartbeat(now_ns);
      } else if (only_answers) {
        send_stream(id, now_ns);
      }
      return;
    } else if (command.command == mav_command::kSetMessageInterval) {
      ++intervals[id];
      if (only_answers) return;
      if (deaf_requests > 0) {
        --deaf_requests;
        return;
      }
      if (unsupported.count(id)) {
        ack.result = mav_result::kDenied;
      } else {
        streams_[id] = 1e6 / static_cast<double>(command.param2);
      }
    }
    send(ack, now_ns);
  }

  void handle_parameter(const std::string& name, int64_t now_ns) {
    const auto found = parameters.find(name);
    if (found == parameters.end()) return;
    ParamValue value;
    set_text(value.param_id, name);
    value.param_type = mav_param_type::kReal32;
    value.param_value = static_cast<float>(found->second);
    const bool integer = found->second == std::round(found->second);
    if (autopilot == mav_autopilot::kPx4 && integer) {
      const auto number = static_cast<int32_t>(found->second);
      value.param_type = mav_param_type::kInt32;
      std::memcpy(&value.param_value, &number, sizeof(number));
    }
    send(value, now_ns);
  }

  FrameParser parser_;
  FrameWriter writer_;
  std::deque<Packet> incoming_, outgoing_;
  std::map<uint32_t, double> streams_;
  std::map<uint32_t, int64_t> last_sent_;
};

// Both on one clock that goes on by a millisecond a step; the link is ticked at 200 Hz.
struct LinkedWorld {
  explicit LinkedWorld(unsigned seed = 0, const VehicleLinkOptions& options = {})
      : autopilot(seed), link(options) {}

  void run(double seconds) {
    for (const int64_t end = now_ns + static_cast<int64_t>(seconds * 1e9); now_ns < end; now_ns += kMs) {
      autopilot.step(now_ns, link);
      if (now_ns % (5 * kMs) == 0) autopilot.receive(link.tick(now_ns), now_ns);
    }
  }

  int64_t now_ns = 1000 * kSecond;
  FakeAutopilot autopilot;
  VehicleLink link;
};

}  // namespace perch::mavlink
