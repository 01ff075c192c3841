#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

namespace perch {

struct EviD30Options {
  // It looks at what came in once a field of NTSC video.
  double field = 1.001 / 60;  // s
  // From an ACK to the motor's start. Nobody has published it; one picture.
  double motor_delay = 0.033;     // s
  double acceleration = 8;        // rad/s^2; nor this: from rest to 80 degrees/s in 0.17 s
  double zoom_speed = 1.0 / 2.2;  // of the whole way a second
  bool over_ip = false;           // the packets come and go in datagrams with sequence numbers
};

// Sony's EVI-D30 as its command list describes it, at the other end of the wire: two sockets, ACK and
// completion, errors, its ranges, speeds and counts. It shares no code with what speaks to it, so that either
// can accuse the other. Times are ns of any clock that does not go back.
class SimulatedEviD30 {
 public:
  explicit SimulatedEviD30(const EviD30Options& options = {}) : options_(options) {}

  // A piece of a stream, or over IP one datagram.
  void receive(std::span<const uint8_t> bytes);
  // Goes on to that time; the packets (datagrams) it sends by then.
  std::vector<std::vector<uint8_t>> advance(int64_t time_ns);

  struct Head {
    int64_t time_ns = 0;
    double pan = 0, tilt = 0;  // rad
    double zoom = 0;           // 0 to 1
  };
  // The truth, up to half a second back.
  Head at(int64_t time_ns) const;

  // Switched off and on, or plugged in anew: it forgets its address and says 38 (network change).
  void restart();
  // Somebody turns it by hand.
  void knock(double pan, double tilt);
  // Somebody zooms it with its remote control.
  void zoom_by_hand(double zoom);

  struct Counters {
    uint64_t packets = 0, commands = 0, inquiries = 0, errors = 0;
  };
  const Counters& counters() const { return counters_; }

 private:
  struct Packet {
    std::vector<uint8_t> bytes;
    uint32_t sequence = 0;
  };
  struct Axis {
    double angle = 0, speed = 0;  // rad, rad/s
    double drive = 0;             // wanted, rad/s
    std::optional<double> goal;   // else drive
    double most = 0;              // speed to the goal
    void step(double dt, double acceleration, double limit);
  };
  struct Order {  // what the motors do, once their delay is over
    int64_t from_ns = 0;
    std::array<double, 2> drive{}, most{};
    std::array<std::optional<double>, 2> goal{};
    bool relative = false;
  };

  void step(int64_t time_ns);
  void execute(const Packet& packet);
  void execute_broadcast(const Packet& packet);
  void inquire(const Packet& packet);
  void command(const Packet& packet);
  void move(const Packet& packet, uint8_t socket);
  void complete(uint8_t socket);
  void error(const Packet& packet, uint8_t socket, uint8_t code);
  void send(std::vector<uint8_t> bytes, uint32_t sequence);
  uint8_t header() const { return static_cast<uint8_t>((8 + address_) << 4); }

  EviD30Options options_;
  int64_t now_ns_ = -1;
  int64_t next_field_ns_ = 0;
  uint8_t address_ = 1;
  std::vector<uint8_t> partial_;
  uint32_t partial_sequence_ = 0;
  std::deque<Packet> inbox_;
  std::vector<std::vector<uint8_t>> outbox_;
  Axis pan_, tilt_;
  double zoom_ = 0, zoom_goal_ = 0;
  struct Socket {
    bool busy = false, moves = false;
    uint32_t sequence = 0;
  };
  std::array<Socket, 3> sockets_{};  // from 1
  std::deque<Order> orders_;
  std::deque<Head> history_;
  Counters counters_;
};

}  // namespace perch
