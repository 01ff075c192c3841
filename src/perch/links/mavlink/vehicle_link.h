#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "perch/links/mavlink/frame.h"
#include "perch/links/mavlink/message_requests.h"
#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/numbers.h"
#include "perch/links/mavlink/parameters.h"
#include "perch/links/mavlink/parser.h"
#include "perch/links/mavlink/stream_requests.h"
#include "perch/links/mavlink/time_sync.h"
#include "perch/links/mavlink/vehicle_history.h"

namespace perch::mavlink {

struct VehicleLinkOptions {
  uint8_t system = 0;  // the vehicle's id; 0: that of the first autopilot heard
  uint8_t component = mav_component::kOnboardComputer;  // ours
  double attitude_hz =
      100;  // at 50 Hz a turn of 5 rad/s^2 is off by 0.25 mrad between samples; fast links bear it
  double position_hz = 30;
  double gimbal_hz = 50;
  // It sends nothing by itself: each message is asked for, one at a time, at these rates or as fast as it
  // answers.
  bool ask_each = false;
  bool gimbal = false;  // ask for the gimbal's stream: only where a gimbal turns the camera
};

// silent: no autopilot yet; lost: one was there, and nothing has come from it for 3.5 s.
//
//   silent --heartbeat--> up --3.5 s of silence--> lost --heartbeat--> up
enum class LinkState { kSilent, kUp, kLost };

// Who is at the other end, as its heartbeats and versions say.
struct Autopilot {
  uint8_t system = 0;
  uint8_t type = 0;       // MAV_TYPE
  uint8_t autopilot = 0;  // MAV_AUTOPILOT
  uint8_t base_mode = 0;
  uint32_t custom_mode = 0;
  std::optional<AutopilotVersion> version;
  std::optional<uint8_t> landed_state;  // MAV_LANDED_STATE

  bool armed() const { return base_mode & kModeFlagArmed; }
  bool is_ardupilot() const { return autopilot == mav_autopilot::kArdupilot; }
  bool is_px4() const { return autopilot == mav_autopilot::kPx4; }
};

struct VehicleLinkStatistics {
  uint64_t heartbeats = 0;
  uint64_t times_up = 0, times_lost = 0;
  uint64_t foreign = 0;              // frames of other systems, and of components that are not ours to hear
  uint64_t times_unknown = 0;        // samples that came before the clocks were matched
  uint64_t times_implausible = 0;    // samples from the future, or from long before they came
  uint64_t times_by_round_trip = 0;  // samples asked for and placed halfway between question and answer
  uint64_t samples_refused = 0;      // not finite, out of order, or from the lesser of two sources
};

struct VehicleText {
  int64_t time_ns = 0;
  uint8_t severity = 0;
  std::string text;  // printable ASCII
};

// One link to one autopilot, with no thread and no input or output of its own:
//
//   VehicleLink link(options);
//   stream.run(5ms, [&](const Chunk& c) { link.receive(c.bytes, c.arrival_ns, c.datagram); });
//   stream.write(link.tick(monotonic_ns()));    // at once, so that TIMESYNC is answered at once; 100 Hz or
//   more stream.write(link.frame_of(landing_target));
//
// It finds the autopilot, sends our heartbeat, matches the clocks, asks for streams, version and parameters,
// and keeps what the vehicle did on our clock. One thread at a time.
//
// Of an autopilot that only answers (ask_each) nothing comes unasked, no heartbeat either. Its clock is
// matched by TIMESYNC where it answers that, else by SYSTEM_TIME, whose time is that of the answer. Where
// neither is there, or a message has no time that can be right, it is of the middle between question and
// answer: off by half the round trip at the most.
class VehicleLink {
 public:
  // `signing` may be null and must outlive the link.
  explicit VehicleLink(const VehicleLinkOptions& options, Signing* signing = nullptr);

  void receive(std::span<const uint8_t> bytes, int64_t arrival_ns, bool datagram);
  // The bytes to send now.
  std::vector<uint8_t> tick(int64_t now_ns);
  // Hears every frame of the vehicle, of each of its components, beside the link.
  void listen(std::function<void(const Frame&)> on_frame) { on_frame_ = std::move(on_frame); }
  // The bytes of one message of ours.
  template <class Message>
  std::vector<uint8_t> frame_of(const Message& message) {
    std::vector<uint8_t> bytes;
    writer_.append(bytes, message);
    return bytes;
  }

  LinkState state() const { return state_; }
  uint8_t component() const { return options_.component; }  // ours
  // Meaningful from the first time the link was up.
  const Autopilot& autopilot() const { return autopilot_; }
  const VehicleHistory& history() const { return history_; }
  const TimeSync& clock() const { return clock_; }
  const ParameterReader& parameters() const { return parameters_; }
  // 0 for one that does not come.
  double rate_hz(uint32_t message_id, int64_t now_ns) const { return streams_.rate_hz(message_id, now_ns); }
  const StreamRequests& streams() const { return streams_; }
  bool asks_each() const { return options_.ask_each; }
  const MessageRequests& requests() const { return requests_; }
  // Wall clock minus our monotonic one as SYSTEM_TIME has it, ns: for file names and logs.
  std::optional<int64_t> unix_minus_monotonic_ns() const { return unix_minus_monotonic_ns_; }
  // The autopilot's STATUSTEXTs since the last call.
  std::vector<VehicleText> take_texts();

  const VehicleLinkStatistics& statistics() const { return statistics_; }
  const ParserStatistics& parser_statistics() const { return parser_.statistics(); }

 private:
  void handle(const Frame& frame, int64_t arrival_ns);
  void handle_heartbeat(const Heartbeat& heartbeat, const Frame& frame, int64_t arrival_ns);
  void handle_of_autopilot(const Frame& frame, int64_t arrival_ns);
  void handle_gimbal(const Frame& frame, int64_t arrival_ns);
  void take_clock_of(const SystemTime& message);
  void notice_clock_steps();
  void handle_timesync(const Timesync& message, const Frame& frame, int64_t arrival_ns);
  void handle_command_ack(const CommandAck& ack, int64_t arrival_ns);
  void handle_system_time(const SystemTime& message, int64_t arrival_ns);
  void handle_text(const Statustext& message, int64_t arrival_ns);
  template <class Message>
  void handle_sample(const Frame& frame, int64_t arrival_ns);
  // A time of the autopilot's clock on ours; empty, and counted, when it cannot be right.
  std::optional<int64_t> plausible(std::optional<int64_t> time_ns, int64_t arrival_ns, bool stamped = true);
  std::optional<int64_t> halfway() const;
  bool comes_again(uint8_t sequence);
  void come_up(const Heartbeat& heartbeat, uint8_t system);
  std::vector<WantedStream> wanted_streams() const;
  std::vector<WantedStream> wanted_messages() const;
  void ask_for_things(int64_t now_ns);
  void ask_for_time(int64_t now_ns);
  void ask_for_a_message(int64_t now_ns);
  template <class Message>
  void send(const Message& message) {
    writer_.append(out_, message);
  }

  VehicleLinkOptions options_;
  std::function<void(const Frame&)> on_frame_;
  FrameParser parser_;
  FrameWriter writer_;
  std::vector<uint8_t> out_;
  LinkState state_ = LinkState::kSilent;
  Autopilot autopilot_;
  TimeSync clock_;
  uint64_t clock_steps_ = 0;
  VehicleHistory history_;
  StreamRequests streams_;
  MessageRequests requests_;
  std::optional<MessageExchange> exchange_;  // that brought the message which is being handled
  std::optional<uint8_t> last_sequence_;     // of the autopilot's frames
  int recent_in_a_row_ = 0;
  uint32_t last_boot_ms_ = 0;                 // of SYSTEM_TIME
  std::map<uint32_t, uint32_t> last_stamps_;  // time_boot_ms of the last sample, by message
  ParameterReader parameters_;
  std::deque<VehicleText> texts_;
  std::optional<int64_t> unix_minus_monotonic_ns_;
  int64_t last_arrival_ns_ = 0;
  int64_t last_heard_ns_ = 0;
  std::optional<int64_t> last_heartbeat_out_ns_;
  int64_t next_version_ns_ = 0;
  VehicleLinkStatistics statistics_;
};

// "4.6.0", as flight_sw_version has it.
std::string version_text(const AutopilotVersion& version);

// Text from the wire as it may be printed: other bytes become '?'.
std::string printable(std::string_view text);

}  // namespace perch::mavlink
