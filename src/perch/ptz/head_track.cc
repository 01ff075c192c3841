#include "perch/ptz/head_track.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

constexpr size_t kReports = 128, kMotions = 256;
// How sure the moment is at which a command shows: a device looks at what it got once a picture.
constexpr double kCommandSigma = 0.02;  // s
// Speeds are the manual's; a motor reaches them to about 5 %.
constexpr double kSpeedSigma = 0.05;
// After a change of speed the motor takes that long to the middle of its ramp, and a report may be that far
// off.
constexpr double kRamp = 0.08;  // s

double seconds(int64_t ns) { return static_cast<double>(ns) * 1e-9; }
int64_t nanoseconds(double s) { return std::llround(s * 1e9); }

}  // namespace

void HeadTrack::clear() {
  reports_.clear();
  suspects_.clear();
  motions_.clear();
}

void HeadTrack::moves(int64_t time_ns, const HeadGoal& goal) {
  Motion motion{time_ns, goal};
  if (goal.kind == HeadGoal::Kind::kRelative) {
    const auto now = at(time_ns);
    if (!now) return;  // its reports will tell
    motion.goal = {HeadGoal::Kind::kAbsolute, now->pan + goal.pan, now->tilt + goal.tilt};
  }
  while (!motions_.empty() && motions_.back().time_ns >= time_ns) motions_.pop_back();
  motions_.push_back(motion);
  if (motions_.size() > kMotions) motions_.pop_front();
}

// The angle at `to_ns` of an axis that was at `from` and did what it was told.
double HeadTrack::moved(const Axis& axis, double from, int64_t from_ns, int64_t to_ns) const {
  double angle = from;
  for (size_t i = 0; i < motions_.size(); ++i) {
    const int64_t begin = std::max(from_ns, motions_[i].time_ns);
    const int64_t end = i + 1 < motions_.size() ? std::min(to_ns, motions_[i + 1].time_ns) : to_ns;
    if (end <= begin) continue;
    const HeadGoal& goal = motions_[i].goal;
    const double dt = seconds(end - begin);
    if (goal.kind == HeadGoal::Kind::kDrive) {
      angle += goal.*axis.goal * dt;
    } else {
      const double most = axis.limits->max_speed * dt;
      angle += std::clamp(goal.*axis.goal - angle, -most, most);
    }
    angle = std::clamp(angle, axis.limits->min, axis.limits->max);
  }
  return angle;
}

// The highest commanded speed from a little before to a little after.
double HeadTrack::fastest(const Axis& axis, int64_t from_ns, int64_t to_ns) const {
  const int64_t margin = nanoseconds(0.1);
  double speed = 0;
  for (size_t i = 0; i < motions_.size(); ++i) {
    const int64_t end = i + 1 < motions_.size() ? motions_[i + 1].time_ns : INT64_MAX;
    if (end < from_ns - margin || motions_[i].time_ns > to_ns + margin) continue;
    const HeadGoal& goal = motions_[i].goal;
    speed = std::max(
        speed, goal.kind == HeadGoal::Kind::kDrive ? std::abs(goal.*axis.goal) : axis.limits->max_speed);
  }
  return speed;
}

// The largest step of the commanded speed that may have happened a little earlier or later than thought.
double HeadTrack::change_near(const Axis& axis, int64_t from_ns, int64_t to_ns, double around) const {
  const int64_t margin = nanoseconds(around);
  double change = 0;
  for (size_t i = 0; i < motions_.size(); ++i) {
    if (motions_[i].time_ns < from_ns - margin || motions_[i].time_ns > to_ns + margin) continue;
    const auto speed = [&](const HeadGoal& goal) {
      return goal.kind == HeadGoal::Kind::kDrive ? goal.*axis.goal : axis.limits->max_speed;
    };
    const double before = i > 0 ? speed(motions_[i - 1].goal) : 0;
    change = std::max(change, std::abs(speed(motions_[i].goal) - before));
  }
  return change;
}

bool HeadTrack::in_range(const Axis& axis, double angle) const {
  const double margin = 2 * axis.limits->count;
  return angle >= axis.limits->min - margin && angle <= axis.limits->max + margin;  // false for NaN
}

bool HeadTrack::reachable(const Axis& axis, const Report& a, const Report& b) const {
  const double dt = seconds(b.time_ns - a.time_ns) + 2 * (a.time_sigma + b.time_sigma);
  return std::abs(b.*axis.angle - a.*axis.angle) <=
         1.1 * axis.limits->max_speed * dt + 2 * axis.limits->count;
}

bool HeadTrack::expected(const Axis& axis, const Report& report) const {
  const Report& last = reports_.back();
  const double angle = moved(axis, last.*axis.angle, last.time_ns, report.time_ns);
  const double dt = seconds(report.time_ns - last.time_ns);
  const double times = 3 * (last.time_sigma + report.time_sigma) + kSpeedSigma * dt;
  const double within = 2 * axis.limits->count + times * fastest(axis, last.time_ns, report.time_ns) +
                        kRamp * change_near(axis, last.time_ns, report.time_ns, 2 * kRamp);
  return std::abs(report.*axis.angle - angle) <= within;
}

HeadTrack::Verdict HeadTrack::add(int64_t time_ns, double time_sigma, double pan_angle, double tilt_angle) {
  const Report report{time_ns, time_sigma, pan_angle, tilt_angle};
  if (!in_range(pan(), pan_angle) || !in_range(tilt(), tilt_angle)) return Verdict::kRefused;
  if (!reports_.empty() && time_ns <= reports_.back().time_ns) return Verdict::kRefused;
  const bool fresh = !reports_.empty() && seconds(time_ns - reports_.back().time_ns) <= kMostGap;
  if (!fresh || !expected(pan(), report) || !expected(tilt(), report)) return suspect(report);
  suspects_.clear();
  reports_.push_back(report);
  if (reports_.size() > kReports) reports_.pop_front();
  return Verdict::kUsed;
}

HeadTrack::Verdict HeadTrack::suspect(const Report& report) {
  if (!suspects_.empty()) {
    const Report& last = suspects_.back();
    const bool follows = report.time_ns > last.time_ns &&
                         seconds(report.time_ns - last.time_ns) <= kMostGap &&
                         reachable(pan(), last, report) && reachable(tilt(), last, report);
    if (!follows) suspects_.clear();
  }
  suspects_.push_back(report);
  if (suspects_.size() < kConfirmed) return Verdict::kWaits;
  // It moves otherwise than it was told, for all that is known as it did just now.
  const Report& first = suspects_.front();
  const double dt = seconds(report.time_ns - first.time_ns);
  moves(first.time_ns,
        {HeadGoal::Kind::kDrive, (report.pan - first.pan) / dt, (report.tilt - first.tilt) / dt});
  reports_.insert(reports_.end(), suspects_.begin(), suspects_.end());
  while (reports_.size() > kReports) reports_.pop_front();
  suspects_.clear();
  return Verdict::kUsed;
}

HeadTrack::Guess HeadTrack::between(const Axis& axis, const Report& a, const Report& b,
                                    int64_t time_ns) const {
  const double s = seconds(time_ns - a.time_ns) / seconds(b.time_ns - a.time_ns);
  const double off = b.*axis.angle - moved(axis, a.*axis.angle, a.time_ns, b.time_ns);
  Guess guess;
  guess.angle = moved(axis, a.*axis.angle, a.time_ns, time_ns) + s * off;
  const double speed = std::abs(b.*axis.angle - a.*axis.angle) / seconds(b.time_ns - a.time_ns);
  const double time_sigma = std::max(a.time_sigma, b.time_sigma);
  // Where in between it got off its way is not known, nor whether it did or the report is garbled a little.
  guess.sigma =
      std::hypot(speed * time_sigma, off / 3,
                 s * (1 - s) * kCommandSigma * change_near(axis, a.time_ns, b.time_ns, 3 * kCommandSigma));
  return guess;
}

HeadTrack::Guess HeadTrack::beyond(const Axis& axis, const Report& last, int64_t time_ns) const {
  Guess guess;
  guess.angle = moved(axis, last.*axis.angle, last.time_ns, time_ns);
  const double dt = seconds(time_ns - last.time_ns);
  const double speed = fastest(axis, last.time_ns, time_ns);
  const double late = std::min(kCommandSigma, dt);
  guess.sigma = std::hypot(speed * last.time_sigma, speed * kSpeedSigma * dt,
                           change_near(axis, last.time_ns, time_ns, 3 * kCommandSigma) * late);
  return guess;
}

std::optional<HeadAngles> HeadTrack::at(int64_t time_ns) const {
  if (reports_.empty() || time_ns < reports_.front().time_ns) return std::nullopt;
  const auto after = std::lower_bound(reports_.begin(), reports_.end(), time_ns,
                                      [](const Report& r, int64_t t) { return r.time_ns < t; });
  Guess pan_guess, tilt_guess;
  if (after == reports_.end()) {
    const Report& last = reports_.back();
    if (!suspects_.empty() || seconds(time_ns - last.time_ns) > kMostAhead) return std::nullopt;
    pan_guess = beyond(pan(), last, time_ns);
    tilt_guess = beyond(tilt(), last, time_ns);
  } else {
    const Report& b = *after;
    const Report& a = after == reports_.begin() ? b : *std::prev(after);
    if (&a == &b) return HeadAngles{b.pan, b.tilt, model_.pan.count, model_.tilt.count};
    if (seconds(b.time_ns - a.time_ns) > kMostGap) return std::nullopt;
    pan_guess = between(pan(), a, b, time_ns);
    tilt_guess = between(tilt(), a, b, time_ns);
  }
  // Rounding to counts, uniform.
  const double rounding = 1 / std::sqrt(12.0);
  return HeadAngles{pan_guess.angle, tilt_guess.angle,
                    std::hypot(pan_guess.sigma, rounding * model_.pan.count),
                    std::hypot(tilt_guess.sigma, rounding * model_.tilt.count)};
}

std::optional<int64_t> HeadTrack::last_report_ns() const {
  if (reports_.empty()) return std::nullopt;
  return reports_.back().time_ns;
}

}  // namespace perch
