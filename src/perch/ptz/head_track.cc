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
// The moment from which a command that was acknowledged works, sooner or later than thought.
constexpr int64_t kSooner = 5'000'000, kLater = 10'000'000;

double seconds(int64_t ns) { return static_cast<double>(ns) * 1e-9; }
int64_t nanoseconds(double s) { return std::llround(s * 1e9); }

}  // namespace

void HeadTrack::clear() {
  reports_.clear();
  suspects_.clear();
  motions_.clear();
  changes_.clear();
}

void HeadTrack::may_move(int64_t from_ns, int64_t to_ns) {
  changes_.push_back({from_ns, to_ns});
  if (changes_.size() > kMotions) changes_.pop_front();
}

void HeadTrack::moves(int64_t time_ns, const HeadGoal& goal) {
  may_move(time_ns - kSooner, time_ns + kLater);
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

// How far b may be from where the commanded motion leads to from a.
double HeadTrack::tolerance(const Axis& axis, const Report& a, const Report& b) const {
  const double dt = seconds(b.time_ns - a.time_ns);
  const double times = 3 * (a.time_sigma + b.time_sigma) + kSpeedSigma * dt;
  return 2 * axis.limits->count + times * fastest(axis, a.time_ns, b.time_ns) +
         kRamp * change_near(axis, a.time_ns, b.time_ns, 2 * kRamp);
}

bool HeadTrack::expected(const Axis& axis, const Report& report) const {
  const Report& last = reports_.back();
  const double angle = moved(axis, last.*axis.angle, last.time_ns, report.time_ns);
  return std::abs(report.*axis.angle - angle) <= tolerance(axis, last, report);
}

// Whether b is where a motion from a to c passes that is off the commanded one by a constant speed.
bool HeadTrack::on_one_motion(const Axis& axis, const Report& a, const Report& b, const Report& c) const {
  if (!reachable(axis, a, b) || !reachable(axis, b, c)) return false;
  const double s = seconds(b.time_ns - a.time_ns) / seconds(c.time_ns - a.time_ns);
  const double off = c.*axis.angle - moved(axis, a.*axis.angle, a.time_ns, c.time_ns);
  const double angle = moved(axis, a.*axis.angle, a.time_ns, b.time_ns) + s * off;
  return std::abs(b.*axis.angle - angle) <= tolerance(axis, a, c) / 2;
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
  if (!suspects_.empty() && (report.time_ns <= suspects_.back().time_ns ||
                             seconds(report.time_ns - suspects_.back().time_ns) > kMostGap))
    suspects_.clear();
  suspects_.push_back(report);
  if (suspects_.size() > 3) suspects_.pop_front();
  if (suspects_.size() < 3) return Verdict::kWaits;
  const Report &a = suspects_[0], &b = suspects_[1], &c = suspects_[2];
  if (!on_one_motion(pan(), a, b, c) || !on_one_motion(tilt(), a, b, c)) return Verdict::kWaits;
  // It moves otherwise than it was told, for all that is known as it did just now.
  const double dt = seconds(c.time_ns - a.time_ns);
  moves(a.time_ns, {HeadGoal::Kind::kDrive, (c.pan - a.pan) / dt, (c.tilt - a.tilt) / dt});
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

// The reports from the one to the other are on a line in time, and nothing that would bend it.
bool HeadTrack::straight(size_t from, size_t to) const {
  if (to >= reports_.size()) return false;
  const Report &a = reports_[from], &c = reports_[to];
  for (const Window& change : changes_) {
    if (change.from_ns < c.time_ns && change.to_ns > a.time_ns) return false;
  }
  const auto on_line = [&](const Axis& axis, const Report& b) {
    const double speed = (c.*axis.angle - a.*axis.angle) / seconds(c.time_ns - a.time_ns);
    const double off = b.*axis.angle - a.*axis.angle - seconds(b.time_ns - a.time_ns) * speed;
    // Rounding of the three, and their moments.
    return std::abs(off) <= axis.limits->count + 3 * std::abs(speed) * std::max(a.time_sigma, b.time_sigma);
  };
  for (size_t i = from + 1; i <= to; ++i) {
    if (seconds(reports_[i].time_ns - reports_[i - 1].time_ns) > kMostGap) return false;
    if (i < to && !(on_line(pan(), reports_[i]) && on_line(tilt(), reports_[i]))) return false;
  }
  return true;
}

bool HeadTrack::as_told(size_t from, size_t to) const {
  const Report &a = reports_[from], &b = reports_[to];
  const auto told = [&](const Axis& axis) {
    const double off = b.*axis.angle - moved(axis, a.*axis.angle, a.time_ns, b.time_ns);
    const double times =
        3 * std::max(a.time_sigma, b.time_sigma) + kSpeedSigma * seconds(b.time_ns - a.time_ns);
    return std::abs(off) <= axis.limits->count + times * fastest(axis, a.time_ns, b.time_ns);
  };
  return told(pan()) && told(tilt());
}

std::optional<HeadAngles> HeadTrack::confirmed_at(int64_t time_ns) const {
  const auto after = std::lower_bound(reports_.begin(), reports_.end(), time_ns,
                                      [](const Report& r, int64_t t) { return r.time_ns < t; });
  const auto b = static_cast<size_t>(after - reports_.begin());
  if (b == 0 || b == reports_.size()) return std::nullopt;
  for (size_t from = b - std::min<size_t>(b, 4); from < b; ++from) {
    if (straight(from, from + 4) || (from + 2 >= b && straight(from, from + 2) && as_told(from, from + 2)))
      return at(time_ns);
  }
  return std::nullopt;
}

std::optional<int64_t> HeadTrack::last_report_ns() const {
  if (reports_.empty()) return std::nullopt;
  return reports_.back().time_ns;
}

}  // namespace perch
