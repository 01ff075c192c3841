#include "perch/links/mavlink/message_requests.h"

#include <algorithm>

#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;

constexpr size_t kRememberedTrips = 8;
// A question and its answer take 90 ms at 9600 baud.
constexpr int64_t kFirstTimeOut = 500 * kMs, kLeastTimeOut = 50 * kMs;
// So long after its question nothing comes any more.
constexpr int64_t kForgotten = kSecond;
// What is never answered, while others are, the autopilot does not know.
constexpr int kFailuresOfUnknown = 3;
constexpr int64_t kUnknownPeriod = 5 * kSecond, kRefusedPeriod = 60 * kSecond;

}  // namespace

void MessageRequests::want(const std::vector<WantedStream>& messages) {
  requests_.clear();
  for (const WantedStream& message : messages) requests_.push_back({.message = message});
  under_way_.reset();
  round_trips_ns_.clear();
  timed_out_in_a_row_ = 0;
}

void MessageRequests::drop(uint32_t id) {
  std::erase_if(requests_, [&](const Request& r) { return r.message.id == id; });
  if (under_way_ == id) under_way_.reset();
}

MessageRequests::Request* MessageRequests::find(uint32_t id) {
  const auto found = std::ranges::find_if(requests_, [&](const Request& r) { return r.message.id == id; });
  return found == requests_.end() ? nullptr : &*found;
}

int64_t MessageRequests::time_out_ns() const {
  if (round_trips_ns_.empty()) return kFirstTimeOut;
  const int64_t longest = *std::ranges::max_element(round_trips_ns_);
  return std::clamp((3 * longest) << std::min(timed_out_in_a_row_, 4), kLeastTimeOut, kFirstTimeOut);
}

void MessageRequests::give_up(Request& request, int64_t now_ns) {
  ++statistics_.timed_out;
  request.in_doubt = true;
  ++request.failed;
  if (request.failed >= kFailuresOfUnknown && !request.ever_answered)
    request.next_ns = now_ns + kUnknownPeriod;
  // Whoever answers much later, or much sooner, than before is measured anew.
  if (++timed_out_in_a_row_ >= 3) round_trips_ns_.clear();
}

// The earliest of those that are due. Where all that are due are in doubt, whichever is not: its answer
// settles them.
MessageRequests::Request* MessageRequests::next(int64_t now_ns) {
  Request* earliest = nullptr;
  bool due = false;
  for (Request& request : requests_) {
    if (request.in_doubt && now_ns - request.asked_ns > kForgotten) request.in_doubt = false;
    due = due || request.next_ns <= now_ns;
    if (!request.in_doubt && (!earliest || request.next_ns < earliest->next_ns)) earliest = &request;
  }
  return due ? earliest : nullptr;
}

std::optional<CommandLong> MessageRequests::ask(int64_t now_ns) {
  if (Request* waiting = under_way_ ? find(*under_way_) : nullptr) {
    if (now_ns - waiting->asked_ns < time_out_ns()) return std::nullopt;
    give_up(*waiting, now_ns);
    under_way_.reset();
  }
  Request* const request = next(now_ns);
  if (!request) return std::nullopt;
  under_way_ = request->message.id;
  request->asked_ns = now_ns;
  // In time with its rate, unless the line is too slow for it: then a whole period from now.
  const auto period_ns = static_cast<int64_t>(1e9 / request->message.rate_hz);
  const bool in_time = now_ns - request->next_ns < period_ns;
  request->next_ns = (in_time ? request->next_ns : now_ns) + period_ns;
  ++statistics_.asked;
  CommandLong command;
  command.command = mav_command::kRequestMessage;
  command.target_component = request->message.component;
  command.param1 = static_cast<float>(request->message.id);
  return command;
}

std::optional<MessageExchange> MessageRequests::heard(uint32_t id, int64_t arrival_ns) {
  Request* const request = find(id);
  if (!request) return std::nullopt;
  request->ever_answered = true;
  request->failed = 0;
  const MessageExchange exchange{request->asked_ns, arrival_ns};
  // Sooner than the line takes it is the answer to an older question, once more.
  const bool too_soon =
      !round_trips_ns_.empty() && exchange.round_trip_ns() < *std::ranges::min_element(round_trips_ns_) / 2;
  if (under_way_ != id || too_soon) {
    ++statistics_.unasked;
    return std::nullopt;
  }
  ++statistics_.answered;
  under_way_.reset();
  timed_out_in_a_row_ = 0;
  round_trips_ns_.push_back(exchange.round_trip_ns());
  if (round_trips_ns_.size() > kRememberedTrips) round_trips_ns_.pop_front();
  for (Request& other : requests_) {
    if (other.asked_ns < request->asked_ns) other.in_doubt = false;
  }
  return exchange;
}

void MessageRequests::acknowledged(uint8_t result, int64_t now_ns) {
  Request* const request = under_way_ ? find(*under_way_) : nullptr;
  const bool refusal = result == mav_result::kTemporarilyRejected || result == mav_result::kDenied ||
                       result == mav_result::kUnsupported || result == mav_result::kFailed;
  // One that is late may be of another message: what has been answered before is known there.
  if (!request || !refusal || request->ever_answered) return;
  ++statistics_.refused;
  under_way_.reset();
  if (result != mav_result::kTemporarilyRejected) request->next_ns = now_ns + kRefusedPeriod;
}

}  // namespace perch::mavlink
