#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>

#include "perch/links/mavlink/messages_system.h"

namespace perch::mavlink {

// remote(t) = t + offset + skew (t - at), t and `at` on our CLOCK_MONOTONIC, ns.
struct ClockEstimate {
  int64_t at_ns = 0;
  int64_t offset_ns = 0;  // remote minus ours
  double skew = 0;        // how much faster the remote clock runs: 5e-5 is 50 ppm
  int64_t sigma_ns = 0;   // of the offset, with what a lopsided way can hide
  int64_t min_round_trip_ns = 0;
};

struct TimeSyncStatistics {
  uint64_t asked = 0;
  uint64_t heard = 0;     // answers to what we asked
  uint64_t answered = 0;  // questions of others
  uint64_t foreign = 0;   // answers to what we did not ask, or too late
  uint64_t outliers = 0;  // answers that contradict the estimate, alone
  uint64_t steps = 0;     // the remote clock was set, or its owner booted: started anew
};

// The autopilot's clock on ours, by TIMESYNC: we ask with our time (ts1), it answers with its own (tc1).
//
//   offset = tc1 - (sent + received) / 2,   wrong by at most half the round trip, and by (there - back) / 2
//   exactly.
//
// The line offset + skew t is fitted to the answers of the last minute. What an answer's round trip has above
// the least seen is time in queues, on one side or the other: answers count the less the longer they were on
// their way. An answer that no split of its round trip can bring in line means that the clock was set; three
// in a row, and we start anew.
//
// What cannot be seen from here: a way there that is always slower than the way back. `sigma_ns` holds it.
class TimeSync {
 public:
  // The question to send now, when one is due: 10 Hz until the estimate is good, or when it is doubtful, then
  // 2 Hz.
  std::optional<Timesync> ask(int64_t now_ns);

  // Takes an answer in; gives the reply to a question.
  std::optional<Timesync> receive(const Timesync& message, int64_t arrival_ns);

  // An exchange by other messages: the remote clock said `remote_ns` between the two moments of ours.
  void exchange(int64_t sent_ns, int64_t arrival_ns, int64_t remote_ns);

  // Empty until three answers came, or when the last is so long ago that the clocks may have drifted apart.
  std::optional<ClockEstimate> estimate(int64_t now_ns) const;

  // The last answer contradicted the estimate. It is asked again quickly; until then no new stamp should be
  // believed.
  bool doubtful() const { return !contradicting_.empty(); }

  // Times of the remote clock on ours; empty without an estimate at `now_ns`.
  std::optional<int64_t> local_from_remote(int64_t remote_ns, int64_t now_ns) const;
  // Of time_boot_ms, which is cut to whole ms and starts anew after 49.7 days.
  std::optional<int64_t> local_from_boot_ms(uint32_t boot_ms, int64_t now_ns) const;

  // Forgets the remote clock: another autopilot is there.
  void restart();

  const TimeSyncStatistics& statistics() const { return statistics_; }

 private:
  struct Sample {
    int64_t middle_ns = 0;  // of the exchange, our clock
    int64_t offset_ns = 0;
    int64_t round_trip_ns = 0;
  };
  // The fitted line, relative to the newest sample.
  struct Line {
    int64_t at_ns = 0;
    int64_t reference_ns = 0;  // an offset near all others, so that doubles hold the rest
    int64_t min_round_trip_ns = 0;
    double offset_ns = 0;  // above the reference
    double skew = 0;
    double var_offset = 0, cov = 0, var_skew = 0;  // ns^2, ns, 1
  };

  void take(const Sample& sample);
  void fit();
  double sigma_at(int64_t now_ns) const;
  double offset_at(int64_t now_ns) const;  // above the reference

  std::array<int64_t, 16> asked_ns_{};  // 0: answered, or never asked
  size_t next_asked_ = 0;
  int64_t last_asked_ns_ = 0;
  std::deque<Sample> samples_;
  std::deque<Sample> contradicting_;
  std::optional<Line> line_;
  TimeSyncStatistics statistics_;
};

}  // namespace perch::mavlink
