#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "perch/links/mavlink/messages_system.h"
#include "perch/links/mavlink/stream_requests.h"

namespace perch::mavlink {

// When a message was asked for, and when it came.
struct MessageExchange {
  int64_t sent_ns = 0, arrival_ns = 0;
  int64_t round_trip_ns() const { return arrival_ns - sent_ns; }
};

struct MessageRequestStatistics {
  uint64_t asked = 0;
  uint64_t answered = 0;
  uint64_t timed_out = 0;
  uint64_t refused = 0;
  uint64_t unasked = 0;  // came without a question under way that it answers: late, twice, or by itself
};

// Messages that are asked for one by one (MAV_CMD_REQUEST_MESSAGE), of an autopilot that sends nothing by
// itself.
//
//   free --ask--> under way --the message, or a refusal--> free
//                     '-------------time-out-------------> free, that message in doubt
//
// An answer does not say which question it belongs to, but answers come in the order of the questions. So a
// message in doubt is asked for again only once a later question, for another message, is answered, or a
// second has passed: what comes of it until then is late, and not taken for the answer to a newer question.
class MessageRequests {
 public:
  // Starts anew with these. The one with the earliest turn is asked for: where the line is too slow for all
  // rates each gets its share.
  void want(const std::vector<WantedStream>& messages);
  // It is known now.
  void drop(uint32_t id);

  // The request to send now, if any; its target is left to the caller.
  std::optional<CommandLong> ask(int64_t now_ns);

  // A message came. The exchange that brought it; empty where it answers no question under way.
  std::optional<MessageExchange> heard(uint32_t id, int64_t arrival_ns);
  // COMMAND_ACK of a request.
  void acknowledged(uint8_t result, int64_t now_ns);

  // How long an answer is waited for now.
  int64_t time_out_ns() const;
  const MessageRequestStatistics& statistics() const { return statistics_; }

 private:
  struct Request {
    WantedStream message;
    int64_t next_ns = 0, asked_ns = 0;
    bool in_doubt = false;
    bool ever_answered = false;
    int failed = 0;  // in a row
  };
  Request* find(uint32_t id);
  Request* next(int64_t now_ns);
  void give_up(Request& request, int64_t now_ns);

  std::vector<Request> requests_;
  std::optional<uint32_t> under_way_;
  std::deque<int64_t> round_trips_ns_;  // the last few
  int timed_out_in_a_row_ = 0;
  MessageRequestStatistics statistics_;
};

}  // namespace perch::mavlink
