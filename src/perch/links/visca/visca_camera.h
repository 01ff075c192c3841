#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "perch/links/visca/parser.h"
#include "perch/ptz/head_track.h"
#include "perch/ptz/ptz_camera.h"

namespace perch::visca {

struct ViscaOptions {
  uint8_t camera = 1;    // its address, 1 to 7
  bool over_ip = false;  // datagrams with sequence numbers
  double baud = 9600;    // of the wire; what a packet's bytes take on it, 10 bits each
  HeadModel head = evi_d30();
  uint16_t zoom_counts = 0x3FF;  // at the narrow end
  // From an ACK to the motor's start, s: one picture. Nobody has published it; measure it where it matters.
  double motor_delay = 0.033;
};

struct ViscaStatistics {
  uint64_t starts = 0;  // address set, or from IF_Clear on
  uint64_t inquiries = 0, positions = 0;
  uint64_t positions_doubted = 0, positions_refused = 0;
  uint64_t commands = 0, acks = 0, completions = 0, errors = 0;
  uint64_t time_outs = 0;
  uint64_t garbled = 0;  // packets that are no answer, or none to what was asked
};

// A VISCA camera with no thread and no input or output of its own:
//
//   stream.run(5ms, [&](const Chunk& c) { camera.receive(c.bytes, c.arrival_ns, c.datagram); });
//   for (const Bytes& packet : camera.tick(monotonic_ns())) stream.write(packet);
//
//   address --88 30 0w--> clear --z0 50--> ready --kMostFailures in a row--> clear --again--> address
//      ^------------------------ z0 38 (network change), at any time ----------------------------'
//
// One packet at a time waits for its answer, as answers do not say what they answer: a command for its ACK,
// an inquiry for its reply. In between positions are asked for again and again, each question so that it gets
// there just before the device looks at what came, which it does once a field of video: of the moment that
// the answer is about the less is unknown. A goal that has not left yet gives way to a newer one; one that
// was not acknowledged is sent again.
class ViscaCamera : public PtzCamera {
 public:
  explicit ViscaCamera(const ViscaOptions& options);

  void receive(std::span<const uint8_t> bytes, int64_t arrival_ns, bool datagram);
  // What to send now, each whole.
  std::vector<Bytes> tick(int64_t now_ns);

  void point(const HeadGoal& goal) override;
  void zoom_to(double zoom) override;
  // On a line that garbled within the last 10 s, only what HeadTrack::confirmed_at says.
  std::optional<HeadAngles> at(int64_t time_ns) const override;
  std::optional<HeadAngles> expected_at(int64_t time_ns) const override { return track_.at(time_ns); }
  std::optional<double> zoom() const override { return zoom_; }
  HeadModel model() const override { return options_.head; }
  bool ready() const override { return state_ == State::kReady; }

  // A command has not left, or was not answered.
  bool busy() const { return goal_ || zoom_goal_ || (waiting_ && waiting_->what == Ask::kMove); }

  const ViscaStatistics& statistics() const { return statistics_; }
  // How long the device took to answer a position inquiry, but for the bytes: its latency, s; 0 before.
  double reaction() const { return reaction_; }

 private:
  enum class State { kAddress, kClear, kReady };
  enum class Ask { kAddress, kClear, kPanTilt, kZoom, kMove, kZoomMove, kCancel };
  static constexpr size_t kAsks = 7;
  struct Waiting {
    Ask what = Ask::kAddress;
    int64_t sent_ns = 0;
    double bits = 0;  // s, that its bytes take on the wire
    uint32_t sequence = 0;
    HeadGoal goal{};
    double zoom = 0;
  };
  // How long to wait with a question after an answer, and what its own answer then took.
  struct Pause {
    double length = 0, took = 0;  // s
    int64_t useless_until_ns = 0;
  };
  // A command in the device, until it says that it is done.
  struct Socket {
    bool busy = false;
    bool moves = false;  // pan and tilt
    int64_t since_ns = 0;
  };

  void start(State state);
  void handle(std::span<const uint8_t> packet, std::optional<uint32_t> sequence, int64_t arrival_ns);
  void handle_answer(const Reply& reply, int64_t arrival_ns);
  void handle_ack(const Reply& reply, int64_t arrival_ns);
  void handle_error(const Reply& reply);
  void take_position(std::span<const uint8_t> payload, int64_t arrival_ns);
  void take_zoom(std::span<const uint8_t> payload);
  void answered(int64_t arrival_ns);
  void learn_pause(double took, int64_t arrival_ns);
  void failed();
  void line_garbles() { garbles_until_ns_ = last_byte_ns_ + kGarblesFor; }
  bool garbles() const { return last_byte_ns_ < garbles_until_ns_; }
  void again(const Waiting& waiting);

  std::optional<Waiting> next(int64_t now_ns);
  Bytes packet_of(const Waiting& waiting) const;
  DriveSteps steps_of(const HeadGoal& goal) const;
  bool says_anything(const HeadGoal& goal) const;
  int free_socket() const;
  double on_wire(size_t bytes) const;

  const ViscaOptions options_;
  State state_ = State::kAddress;
  Parser parser_;
  HeadTrack track_;
  ViscaStatistics statistics_;

  std::optional<Waiting> waiting_;
  std::array<Pause, kAsks> pauses_{};  // by what was answered before
  Ask answered_ = Ask::kAddress;
  int64_t answered_ns_ = 0;
  std::array<Socket, 3> sockets_{};  // from 1
  std::optional<HeadGoal> goal_;     // to be sent
  std::optional<double> zoom_goal_, zoom_told_;
  int zooms_retold_ = 0;
  std::optional<DriveSteps> driving_;  // what the device acknowledged last
  static constexpr int64_t kGarblesFor = 10'000'000'000;
  int64_t garbles_until_ns_ = 0;
  int64_t driving_since_ns_ = 0, hold_until_ns_ = 0, last_command_ns_ = 0, last_zoom_ns_ = 0,
          last_byte_ns_ = 0, last_tick_ns_ = 0;
  int failures_ = 0, restarts_ = 0, goal_tries_ = 0;
  uint32_t sequence_ = 0;
  bool reset_sequence_ = true;
  double reaction_ = 0;
  std::optional<double> zoom_, zoom_suspect_;
};

}  // namespace perch::visca
