#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "perch/station/state_ring.h"

namespace perch {

// What one client is to be sent next, so that its budget is kept and a slow radio is not filled with what is
// old when it arrives. States come first, then what it missed, and pictures only where room is left.
//
//   tokens   bytes that the budget allows now; a second's worth at most
//   flight   bytes that were sent and are not acknowledged: what lies in the radio and its queues
//
//   live rows   while flight is small; thinned evenly to what the tokens allow, the newest always among them
//   a gap       while little is in flight and tokens are left, newest first; a long one thinned
//   a picture   with tokens for it and half a second of rows, while a gap is filled one in two seconds; in
//   parts,
//               each while little is in flight, so that no row waits behind a whole one
//
// No input or output, no clock: time comes in.
class ClientFeed {
 public:
  ClientFeed(double bandwidth_kbit, int64_t now_ns);

  // Rows from here on are wanted (0: all there are). What is there by now is the gap.
  void ask_from(uint32_t sequence, const StateRing& ring);
  // Sequence numbers to be sent now in one message, ascending; empty: none.
  std::vector<uint32_t> next_rows(const StateRing& ring, int64_t now_ns);
  // Nothing that was missed is left to be sent.
  bool whole() const { return gap_end_ <= gap_first_; }
  bool may_begin_picture(int64_t now_ns);
  bool may_send_part(int64_t now_ns) const;
  size_t part_bytes() const { return part_bytes_; }

  // A picture of so many bytes is what comes next, in parts.
  void began_picture(size_t bytes, int64_t now_ns);
  // Each message that is written, in its order, and that the client says it has: all up to this number, from
  // 1. False for one that was never sent.
  void sent(size_t bytes, int64_t now_ns);
  bool acknowledged(uint64_t message, int64_t now_ns);

  size_t in_flight() const { return in_flight_; }
  // How long the oldest message has not been acknowledged, s.
  double stalled(int64_t now_ns) const;

  // A message's frames of TCP/IP and WebSocket.
  static constexpr size_t kOverhead = 60;
  // Half a second at 64 kbit/s: with more on its way no states are sent.
  static constexpr size_t kMostInFlight = 4000;
  // States of 0.4 s, as they are on their way all the time: with more, or with some that is on its way for
  // longer than distance alone explains, nothing but states is sent.
  static constexpr size_t kLittleInFlight = 2500;
  static constexpr int64_t kShortlyInFlight = 500'000'000;  // ns
  // Rows of a gap, evenly over it: 10 s at full rate, 5 minutes at 3 Hz; 8 s of the default budget.
  static constexpr uint32_t kMostGapRows = 900;
  static constexpr int64_t kRowsEvery = 100'000'000;  // ns: what comes in between shares a message

 private:
  struct Message {
    size_t bytes;
    int64_t sent_ns;
  };
  void refill(int64_t now_ns);
  std::vector<uint32_t> live_rows(const StateRing& ring, size_t room);
  std::vector<uint32_t> gap_rows(const StateRing& ring, size_t room);

  double bytes_per_second_;
  double tokens_;
  size_t part_bytes_;
  double picture_bytes_ = 8000;  // of the last one, as the next may be
  int64_t refilled_ns_;
  int64_t rows_ns_ = 0;
  std::optional<int64_t> picture_ns_;  // when the last was begun
  bool asked_ = false;
  uint32_t live_from_ = 0;                // the next live row
  uint32_t gap_first_ = 0, gap_end_ = 0;  // what is left of the gap
  uint32_t gap_stride_ = 1;
  std::deque<Message> messages_;  // in flight
  uint64_t acknowledged_ = 0;
  size_t in_flight_ = 0;
  int64_t progress_ns_;
};

}  // namespace perch
