#include "perch/links/mavlink/stream_requests.h"

#include <algorithm>

#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

constexpr int64_t kSecond = 1'000'000'000;
constexpr int64_t kWindow = 2 * kSecond;
// Autopilots round intervals to their loop, and links lose some: asking again would change nothing.
constexpr double kEnough = 0.7;
constexpr int64_t kAnswerWithin = 500'000'000;
// The first rate is known after a window.
constexpr int64_t kFirstRetry = 3 * kSecond, kLastRetry = 15 * kSecond, kRetryRefused = 60 * kSecond;

}  // namespace

void StreamRequests::want(const std::vector<WantedStream>& streams) {
  wanted_ = streams;
  requests_.clear();
  meters_.clear();
  under_way_.reset();
}

void StreamRequests::set_component(uint32_t id, uint8_t component) {
  for (WantedStream& stream : wanted_) {
    if (stream.id != id || stream.component == component) continue;
    stream.component = component;
    requests_.erase(id);
  }
}

void StreamRequests::heard(uint32_t id, int64_t now_ns) {
  Meter& meter = meters_[id];
  if (meter.count == 0 && meter.rate_hz == 0) meter.window_ns = now_ns;
  meter.last_ns = now_ns;
  if (const int64_t past = now_ns - meter.window_ns; past >= kWindow) {
    meter.rate_hz = meter.count / (static_cast<double>(past) * 1e-9);
    meter.window_ns = now_ns;
    meter.count = 0;
  }
  ++meter.count;
}

double StreamRequests::rate_hz(uint32_t id, int64_t now_ns) const {
  const auto meter = meters_.find(id);
  if (meter == meters_.end() || now_ns - meter->second.last_ns > kWindow) return 0;
  const double past = static_cast<double>(now_ns - meter->second.window_ns) * 1e-9;
  // In its first window: what it would be if it went on so; one message makes no rate.
  if (meter->second.rate_hz == 0) return past > 0.5 ? (meter->second.count - 1) / past : 0;
  return meter->second.rate_hz;
}

bool StreamRequests::refused(uint32_t id) const {
  const auto request = requests_.find(id);
  return request != requests_.end() && request->second.refused;
}

void StreamRequests::acknowledged(uint8_t result, int64_t now_ns) {
  if (!under_way_) return;
  Request& request = requests_[*under_way_];
  under_way_.reset();
  request.refused =
      result == mav_result::kDenied || result == mav_result::kUnsupported || result == mav_result::kFailed;
  if (request.refused) request.next_ns = now_ns + kRetryRefused;
}

std::optional<CommandLong> StreamRequests::ask(int64_t now_ns) {
  // One at a time: an answer does not say to which stream it belongs.
  if (under_way_ && now_ns - asked_ns_ < kAnswerWithin) return std::nullopt;
  under_way_.reset();
  for (const WantedStream& stream : wanted_) {
    Request& request = requests_[stream.id];
    if (now_ns < request.next_ns) continue;
    if (rate_hz(stream.id, now_ns) >= kEnough * stream.rate_hz) {
      request = {0, now_ns + kWindow, false};
      continue;
    }
    request.next_ns = now_ns + std::min(kLastRetry, kFirstRetry << std::min(request.tries, 3));
    ++request.tries;
    under_way_ = stream.id;
    asked_ns_ = now_ns;
    CommandLong command;
    command.command = mav_command::kSetMessageInterval;
    command.target_component = stream.component;
    command.param1 = static_cast<float>(stream.id);
    command.param2 = static_cast<float>(1e6 / stream.rate_hz);
    return command;
  }
  return std::nullopt;
}

}  // namespace perch::mavlink
