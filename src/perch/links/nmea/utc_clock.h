#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace perch::nmea {

// UTC as a receiver tells it, on our CLOCK_MONOTONIC, by when its sentences come: nobody answers a question
// here.
//
//   offset = least of (arrival - UTC) over the last half minute
//
// What a sentence is later than the quickest it spent in queues: behind other sentences, in a USB frame, in
// this process. What every sentence takes, the receiver's own work and the line, cannot be seen: it stays in
// frames.time_offset. Over half a minute our clock and UTC drift apart by 1.5 ms at 50 ppm.
//
// A sentence that is earlier than the quickest by more than 50 ms, or a second later, contradicts. One alone
// is garbage; three in a row that agree mean that the receiver's clock was set (its leap seconds have come,
// it lost power), or that what came before had waited somewhere: we start anew with them.
class UtcClock {
 public:
  // Takes the time of day (ns) of a sentence. False when it contradicts: the rest of the sentence is not to
  // be believed either.
  bool take(int64_t of_day_ns, int64_t arrival_ns);

  // Of a time of day within half a day of `near_ns`; empty before three sentences have come, and after 10 s
  // of silence.
  std::optional<int64_t> local_from_utc(int64_t of_day_ns, int64_t near_ns) const;

  // How much later than the quickest a sentence of the last half minute was, ns; half of them were less.
  std::optional<int64_t> median_lateness_ns(int64_t now_ns) const;

  uint64_t steps() const { return steps_; }

 private:
  struct Sample {
    int64_t arrival_ns = 0;
    int64_t offset_ns = 0;  // arrival - UTC, within half a day of 0
  };
  bool known(int64_t now_ns) const;
  void add(const Sample& sample);

  std::deque<Sample> samples_;  // of the last half minute
  int64_t least_ns_ = 0;        // of their offsets
  std::vector<Sample> contradicting_;
  uint64_t steps_ = 0;
};

}  // namespace perch::nmea
