#include "perch/links/mavlink/time_sync.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;

constexpr int64_t kAskFast = 100 * kMs;
constexpr int64_t kAskSlow = 500 * kMs;
constexpr size_t kFewSamples = 20;  // while fewer, ask fast: 2 s
constexpr size_t kEnoughSamples = 3;
constexpr size_t kMaxSamples = 256;
// Temperature bends a crystal's line by some ppm over minutes, not over one.
constexpr int64_t kWindow = 60 * kSecond;
// An answer that was longer on its way tells nothing.
constexpr int64_t kTooLate = kSecond;
// Autopilots' crystals are off by tens of ppm.
constexpr double kSkewSigma = 1e-4;
// What runs this wrong is no clock, but answers without a meaning.
constexpr double kNoClock = 5e-3;
// The remote side's own delay, scheduling and rounding, even on a quick way.
constexpr double kFloorNs = 0.1e6;
// What a clock may be off and still place an image: with more it is said to be unknown.
constexpr double kMaxSigmaNs = 20e6;
constexpr size_t kContradictionsOfAStep = 3;

}  // namespace

std::optional<Timesync> TimeSync::ask(int64_t now_ns) {
  const int64_t period = samples_.size() < kFewSamples || doubtful() ? kAskFast : kAskSlow;
  if (statistics_.asked > 0 && now_ns - last_asked_ns_ < period) return std::nullopt;
  last_asked_ns_ = now_ns;
  asked_ns_[next_asked_] = now_ns;
  next_asked_ = (next_asked_ + 1) % asked_ns_.size();
  ++statistics_.asked;
  Timesync question;
  question.ts1 = now_ns;
  return question;
}

std::optional<Timesync> TimeSync::receive(const Timesync& message, int64_t arrival_ns) {
  if (message.tc1 == 0) {
    ++statistics_.answered;
    Timesync reply;
    reply.tc1 = arrival_ns;
    reply.ts1 = message.ts1;
    return reply;
  }
  const auto asked = std::find(asked_ns_.begin(), asked_ns_.end(), message.ts1);
  if (message.ts1 == 0 || asked == asked_ns_.end() || arrival_ns < *asked || arrival_ns - *asked > kTooLate) {
    ++statistics_.foreign;
    return std::nullopt;
  }
  const int64_t sent_ns = std::exchange(*asked, 0);
  ++statistics_.heard;
  exchange(sent_ns, arrival_ns, message.tc1);
  return std::nullopt;
}

void TimeSync::exchange(int64_t sent_ns, int64_t arrival_ns, int64_t remote_ns) {
  const int64_t round_trip = arrival_ns - sent_ns;
  const int64_t middle = sent_ns + round_trip / 2;
  // A remote time of more than 146 years is none: the difference must not overflow.
  constexpr int64_t kLongest = int64_t{1} << 62;
  if (remote_ns < 0 || remote_ns > kLongest) {
    ++statistics_.outliers;
    return;
  }
  take({middle, remote_ns - middle, round_trip});
}

void TimeSync::take(const Sample& sample) {
  if (line_ && samples_.size() >= kEnoughSamples) {
    const double off =
        static_cast<double>(sample.offset_ns - line_->reference_ns) - offset_at(sample.middle_ns);
    const double possible =
        static_cast<double>(sample.round_trip_ns) / 2 + 4 * sigma_at(sample.middle_ns) + kFloorNs;
    if (std::abs(off) > possible) {
      contradicting_.push_back(sample);
      ++statistics_.outliers;
      if (contradicting_.size() < kContradictionsOfAStep) return;
      samples_.assign(contradicting_.begin(), contradicting_.end());
      contradicting_.clear();
      statistics_.outliers -= kContradictionsOfAStep;
      ++statistics_.steps;
      fit();
      return;
    }
  }
  contradicting_.clear();
  samples_.push_back(sample);
  while (samples_.size() > kMaxSamples || samples_.back().middle_ns - samples_.front().middle_ns > kWindow)
    samples_.pop_front();
  fit();
}

// Weighted least squares for (offset, skew), with what is known of the skew beforehand as one more equation.
void TimeSync::fit() {
  Line line;
  line.at_ns = samples_.back().middle_ns;
  line.reference_ns = samples_.back().offset_ns;
  const auto quickest =
      std::min_element(samples_.begin(), samples_.end(),
                       [](const Sample& a, const Sample& b) { return a.round_trip_ns < b.round_trip_ns; });
  line.min_round_trip_ns = quickest->round_trip_ns;
  double w = 0, wt = 0, wtt = 1 / (kSkewSigma * kSkewSigma), wy = 0, wty = 0;
  for (const Sample& sample : samples_) {
    const double queued = static_cast<double>(sample.round_trip_ns - line.min_round_trip_ns);
    const double sigma = kFloorNs + queued / 2;
    const double weight = 1 / (sigma * sigma);
    const double t = static_cast<double>(sample.middle_ns - line.at_ns);
    const double y = static_cast<double>(sample.offset_ns - line.reference_ns);
    w += weight;
    wt += weight * t;
    wtt += weight * t * t;
    wy += weight * y;
    wty += weight * t * y;
  }
  const double determinant = w * wtt - wt * wt;  // above 0: the prior alone makes wtt larger than wt^2 / w
  line.offset_ns = (wtt * wy - wt * wty) / determinant;
  line.skew = (w * wty - wt * wy) / determinant;
  line.var_offset = wtt / determinant;
  line.cov = -wt / determinant;
  line.var_skew = w / determinant;
  line_ = line;
}

double TimeSync::offset_at(int64_t now_ns) const {
  return line_->offset_ns + line_->skew * static_cast<double>(now_ns - line_->at_ns);
}

double TimeSync::sigma_at(int64_t now_ns) const {
  const double t = static_cast<double>(now_ns - line_->at_ns);
  const double fitted = line_->var_offset + 2 * t * line_->cov + t * t * line_->var_skew;
  // The quickest round trip may be all on one side: even spread over +- half of it.
  const double lopsided = static_cast<double>(line_->min_round_trip_ns) / (2 * std::sqrt(3.0));
  return std::sqrt(fitted + lopsided * lopsided);
}

std::optional<ClockEstimate> TimeSync::estimate(int64_t now_ns) const {
  if (!line_ || samples_.size() < kEnoughSamples) return std::nullopt;
  const double sigma = sigma_at(now_ns);
  if (!(sigma < kMaxSigmaNs) || std::abs(line_->skew) > kNoClock) return std::nullopt;
  return ClockEstimate{now_ns, line_->reference_ns + std::llround(offset_at(now_ns)), line_->skew,
                       std::llround(sigma), line_->min_round_trip_ns};
}

std::optional<int64_t> TimeSync::local_from_remote(int64_t remote_ns, int64_t now_ns) const {
  const auto clock = estimate(now_ns);
  if (!clock) return std::nullopt;
  // Times come from the wire: in doubles, whose limits are far.
  const double ago = static_cast<double>(remote_ns) - static_cast<double>(now_ns + clock->offset_ns);
  if (std::abs(ago) > 1e3 * kSecond) return std::nullopt;
  const int64_t difference = remote_ns - (now_ns + clock->offset_ns);
  return now_ns + std::llround(static_cast<double>(difference) / (1 + clock->skew));
}

std::optional<int64_t> TimeSync::local_from_boot_ms(uint32_t boot_ms, int64_t now_ns) const {
  const auto clock = estimate(now_ns);
  if (!clock) return std::nullopt;
  const int64_t remote_now_ms = (now_ns + clock->offset_ns) / kMs;
  const auto behind = static_cast<int32_t>(boot_ms - static_cast<uint32_t>(remote_now_ms));
  // Cut to whole ms it is half of one early on the average.
  return local_from_remote((remote_now_ms + behind) * kMs + kMs / 2, now_ns);
}

void TimeSync::restart() {
  samples_.clear();
  contradicting_.clear();
  line_.reset();
  asked_ns_.fill(0);
}

}  // namespace perch::mavlink
