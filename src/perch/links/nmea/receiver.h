#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "perch/geometry/geodetic.h"
#include "perch/links/mavlink/vehicle_history.h"
#include "perch/links/nmea/confirmed.h"
#include "perch/links/nmea/messages.h"
#include "perch/links/nmea/sentence.h"
#include "perch/links/nmea/utc_clock.h"
#include "perch/tracking/autopilot_sample.h"

namespace perch::nmea {

struct ReceiverOptions {
  std::optional<Geodetic> origin;  // of the world's NED axes; without: the first fix that others confirm
};

// Where the receiver says that the body is: its antenna, or the point that it was told to speak of.
struct PositionFix {
  int64_t time_ns = 0;                                             // CLOCK_MONOTONIC
  Eigen::Vector3d body_in_ned = Eigen::Vector3d::Zero();           // m
  Eigen::Vector3d body_velocity_in_ned = Eigen::Vector3d::Zero();  // m/s
  std::optional<Eigen::Quaterniond> ned_from_body;                 // where an attitude is told
};

// How far off the receiver may be: one standard deviation, m.
struct PositionAccuracy {
  double horizontal = 0, vertical = 0;  // of each horizontal axis
  bool told = false;                    // by GST; else HDOP times what is usual for the kind of fix
};

struct ReceiverStatistics {
  uint64_t fixes = 0;
  uint64_t attitudes = 0;
  uint64_t malformed = 0;      // sentences with a good checksum and fields that cannot be
  uint64_t no_fix = 0;         // GGA without one, or with one that is no measurement
  uint64_t times_refused = 0;  // before the clocks were matched, or against them
  uint64_t jumps_refused = 0;  // positions and attitudes that did not follow and were not confirmed
  uint64_t repeated = 0;       // of a moment that is not later than the last one's
};

// An NMEA receiver, with no thread and no input of its own: positions by GGA, velocities by RMC, attitudes by
// PASHR and its like (messages.h). One thread at a time.
//
// NMEA's checksum is one byte of parity: of sentences with two or more bytes garbled one in a few hundred, or
// with single flipped bits one in ten, pass it. So nothing is believed by itself: the time has to fit the
// clock, positions and attitudes the ones before, or be confirmed by the next two.
class Receiver {
 public:
  explicit Receiver(const ReceiverOptions& options = {});

  void receive(std::span<const uint8_t> bytes, int64_t arrival_ns);

  // The positions that are complete now: with their velocity, and an attitude where one is told.
  std::vector<PositionFix> take_fixes(int64_t now_ns);
  // Attitudes for the filter since the last call, 60 Hz at the most.
  std::vector<AutopilotSample> take_attitudes();

  // The attitudes alone: between two of them, and up to 0.1 s beyond the last.
  const mavlink::VehicleHistory& history() const { return history_; }
  const std::optional<LocalFrame>& frame() const { return frame_; }
  // Of the last fix; kNone after 3 s without.
  FixQuality quality(int64_t now_ns) const;
  int satellites() const { return satellites_; }
  std::optional<PositionAccuracy> accuracy(int64_t now_ns) const;
  // Of the last two to four seconds.
  double fix_hz(int64_t now_ns) const { return fix_rate_.hz(now_ns); }
  double attitude_hz(int64_t now_ns) const { return attitude_rate_.hz(now_ns); }

  const UtcClock& clock() const { return clock_; }
  const ReceiverStatistics& statistics() const { return statistics_; }
  const SentenceStatistics& sentence_statistics() const { return parser_.statistics(); }

 private:
  struct Fix {
    int64_t time_ns = 0, arrival_ns = 0;
    Geodetic place;
  };
  struct Lying {
    int64_t time_ns = 0;
    Eigen::Quaterniond ned_from_body;
  };
  struct Pending {
    PositionFix fix;
    int64_t arrival_ns = 0;
    bool has_velocity = false;
    bool by_positions = false;  // its velocity is that since the fix before
  };
  class Rate {
   public:
    void count(int64_t now_ns);
    double hz(int64_t now_ns) const;

   private:
    int64_t begin_ns_ = 0, last_ns_ = 0;
    int counted_ = 0;
    double hz_ = 0;
  };

  void handle(const Gga& message, int64_t arrival_ns);
  void handle(const Rmc& message, int64_t arrival_ns);
  void handle(const Gst& message, int64_t arrival_ns);
  void handle(const TrueHeading& message, int64_t arrival_ns);
  void handle(const Attitude& message, int64_t arrival_ns);
  std::optional<int64_t> time_of(int64_t of_day_ns, int64_t arrival_ns);
  bool is_flown(const Eigen::Vector3d& way, double dt) const;
  void add_fix(const Fix& fix);
  void give_velocity(Pending& pending);
  bool complete(const Pending& pending, int64_t now_ns) const;

  ReceiverOptions options_;
  SentenceParser parser_;
  UtcClock clock_;
  uint64_t clock_steps_ = 0;
  std::optional<LocalFrame> frame_;
  mavlink::VehicleHistory history_;
  Confirmed<Fix> fixes_;
  Confirmed<Lying> attitudes_;
  std::deque<Pending> pending_;  // wait for what else is said of their moment
  std::optional<PositionFix> last_;
  std::optional<Eigen::Vector3d> last_velocity_;  // there, where it is known
  std::vector<AutopilotSample> said_;
  int64_t last_said_ns_ = 0;
  std::optional<double> heading_;             // of HDT
  int64_t heading_ns_ = 0, stood_in_ns_ = 0;  // of the last; of the last that stood in for an attitude's
  struct Velocity {
    int64_t time_ns = 0, arrival_ns = 0;
    Eigen::Vector2d north_east = Eigen::Vector2d::Zero();  // m/s
  };
  std::optional<Velocity> velocity_;           // the last of RMC
  int64_t last_fix_ns_ = 0, last_gst_ns_ = 0;  // arrivals
  FixQuality quality_ = FixQuality::kNone;
  int satellites_ = 0;
  std::optional<double> hdop_;
  Gst gst_;
  Rate fix_rate_, attitude_rate_;
  ReceiverStatistics statistics_;
};

}  // namespace perch::nmea
