#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "perch/frames/frame_chain.h"
#include "perch/ptz/head_model.h"
#include "perch/ptz/ptz_camera.h"

namespace perch {

// Where a head was at the moment of an exposure, from what it says of itself some 20 times a second and from
// how it was told to move in between:
//
//   between two reports i, j   a(t) = a_i + m(t_i, t) + s (a_j - a_i - m(t_i, t_j)),  s = (t - t_i) / (t_j -
//   t_i) after the last one         a(t) = a_n + m(t_n, t), for kMostAhead
//
// m is the commanded motion. Wires garble reports: one that the motion before does not lead to is not used
// until two more in a row confirm it, all three on a motion that is off the commanded one by a constant
// speed; meanwhile nobody knows where the head is. (The same bit of the same byte would have to fall over
// three times running.)
class HeadTrack {
 public:
  explicit HeadTrack(const HeadModel& model) : model_(model) {}

  // What the head does from this moment on. kRelative counts from where it is then.
  void moves(int64_t time_ns, const HeadGoal& goal);
  // Within this time a command may have begun to work, or not.
  void may_move(int64_t from_ns, int64_t to_ns);

  enum class Verdict { kUsed, kWaits, kRefused };
  // `time_sigma` in s: how well the moment of the report is known.
  Verdict add(int64_t time_ns, double time_sigma, double pan, double tilt);

  std::optional<HeadAngles> at(int64_t time_ns) const;
  // The same on a line that garbles, where a command that became another and a report that became what was
  // expected may agree: known only between reports that lie, with a third next to them, on a straight motion
  // in which no command began to work; with two more where that motion is none that was commanded.
  std::optional<HeadAngles> confirmed_at(int64_t time_ns) const;
  // The moment of the last report that is believed.
  std::optional<int64_t> last_report_ns() const;

  void clear();

  static constexpr double kMostAhead = 0.15;  // s: three reports that are missing
  static constexpr double kMostGap = 0.4;     // s, between two reports

 private:
  struct Report {
    int64_t time_ns = 0;
    double time_sigma = 0;
    double pan = 0, tilt = 0;
  };
  struct Motion {
    int64_t time_ns = 0;
    HeadGoal goal;  // kDrive or kAbsolute
  };
  struct Window {
    int64_t from_ns = 0, to_ns = 0;
  };
  struct Axis {
    double Report::*angle;
    double HeadGoal::*goal;
    const AxisLimits* limits;
  };
  struct Guess {
    double angle = 0, sigma = 0;
  };

  Axis pan() const { return {&Report::pan, &HeadGoal::pan, &model_.pan}; }
  Axis tilt() const { return {&Report::tilt, &HeadGoal::tilt, &model_.tilt}; }
  double moved(const Axis& axis, double from, int64_t from_ns, int64_t to_ns) const;
  double fastest(const Axis& axis, int64_t from_ns, int64_t to_ns) const;
  double change_near(const Axis& axis, int64_t from_ns, int64_t to_ns, double around) const;
  bool in_range(const Axis& axis, double angle) const;
  bool reachable(const Axis& axis, const Report& a, const Report& b) const;
  double tolerance(const Axis& axis, const Report& a, const Report& b) const;
  bool expected(const Axis& axis, const Report& report) const;
  bool on_one_motion(const Axis& axis, const Report& a, const Report& b, const Report& c) const;
  bool straight(size_t from, size_t to) const;
  bool as_told(size_t from, size_t to) const;
  Guess between(const Axis& axis, const Report& a, const Report& b, int64_t time_ns) const;
  Guess beyond(const Axis& axis, const Report& last, int64_t time_ns) const;
  Verdict suspect(const Report& report);

  HeadModel model_;
  std::deque<Report> reports_;
  std::deque<Report> suspects_;  // the last three at most
  std::deque<Motion> motions_;
  std::deque<Window> changes_;  // when the motion may have become another
};

}  // namespace perch
