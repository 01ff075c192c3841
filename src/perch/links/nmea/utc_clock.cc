#include "perch/links/nmea/utc_clock.h"

#include <algorithm>

namespace perch::nmea {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;
constexpr int64_t kDay = 86'400 * kSecond;

constexpr int64_t kWindow = 30 * kSecond;
constexpr int64_t kSilent = 10 * kSecond;
constexpr size_t kEnough = 3;
// Three sentences each 100 times a second; more would only cost memory.
constexpr size_t kMostSamples = 9000;
// Quicker ones come a little at a time; a receiver's clock is not set by so little.
constexpr int64_t kEarly = 50 * kMs;
// What is a second old when it comes is of no use.
constexpr int64_t kLate = kSecond;
// A line that was cut and catches up is late for so long at most; a clock that was set stays so.
constexpr int64_t kCatchesUp = 10 * kSecond;
// Those that mean the same step agree within what queues do to them.
constexpr int64_t kAgree = 500 * kMs;

// Whole days do not count.
int64_t within_half_a_day(int64_t ns) {
  const int64_t rest = ns % kDay;
  return rest >= kDay / 2 ? rest - kDay : rest < -kDay / 2 ? rest + kDay : rest;
}

}  // namespace

bool UtcClock::take(int64_t of_day_ns, int64_t arrival_ns) {
  const Sample sample{arrival_ns, within_half_a_day(arrival_ns - of_day_ns)};
  const int64_t later = samples_.empty() ? 0 : within_half_a_day(sample.offset_ns - least_ns_);
  if (later >= -kEarly && later <= kLate) {
    contradicting_.clear();
    add({arrival_ns, samples_.empty() ? sample.offset_ns : least_ns_ + later});
    return known(arrival_ns);
  }
  const auto agrees = [&](const Sample& other) {
    return std::abs(within_half_a_day(sample.offset_ns - other.offset_ns)) < kAgree;
  };
  if (!std::all_of(contradicting_.begin(), contradicting_.end(), agrees)) contradicting_.clear();
  contradicting_.push_back(sample);
  if (contradicting_.size() < kEnough) return false;
  if (later > kLate && arrival_ns - contradicting_.front().arrival_ns < kCatchesUp) {
    if (contradicting_.size() > kEnough) contradicting_.erase(contradicting_.begin() + 1);
    return false;
  }
  samples_.clear();
  ++steps_;
  for (const Sample& s : contradicting_) {
    add({s.arrival_ns, sample.offset_ns + within_half_a_day(s.offset_ns - sample.offset_ns)});
  }
  contradicting_.clear();
  return true;
}

void UtcClock::add(const Sample& sample) {
  least_ns_ = samples_.empty() ? sample.offset_ns : std::min(least_ns_, sample.offset_ns);
  samples_.push_back(sample);
  bool least_left = false;
  while (samples_.size() > kMostSamples || samples_.front().arrival_ns < sample.arrival_ns - kWindow) {
    least_left = least_left || samples_.front().offset_ns == least_ns_;
    samples_.pop_front();
  }
  if (!least_left) return;
  least_ns_ = std::min_element(samples_.begin(), samples_.end(), [](const Sample& a, const Sample& b) {
                return a.offset_ns < b.offset_ns;
              })->offset_ns;
}

bool UtcClock::known(int64_t now_ns) const {
  return samples_.size() >= kEnough && now_ns - samples_.back().arrival_ns < kSilent;
}

std::optional<int64_t> UtcClock::local_from_utc(int64_t of_day_ns, int64_t near_ns) const {
  if (!known(near_ns)) return std::nullopt;
  return near_ns + within_half_a_day(of_day_ns + least_ns_ - near_ns);
}

std::optional<int64_t> UtcClock::median_lateness_ns(int64_t now_ns) const {
  if (!known(now_ns)) return std::nullopt;
  std::vector<int64_t> late;
  for (const Sample& sample : samples_) late.push_back(sample.offset_ns - least_ns_);
  const auto middle = late.begin() + static_cast<std::ptrdiff_t>(late.size() / 2);
  std::nth_element(late.begin(), middle, late.end());
  return *middle;
}

}  // namespace perch::nmea
