#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "perch/links/mavlink/messages_system.h"

namespace perch::mavlink {

struct WantedStream {
  uint32_t id = 0;
  double rate_hz = 0;
  uint8_t component = 1;  // who sends it
};

// How often each message comes, and SET_MESSAGE_INTERVAL for those that come too seldom, again and again with
// patience: an autopilot that boots forgets, and a lossy link loses the request.
class StreamRequests {
 public:
  // Starts anew with these.
  void want(const std::vector<WantedStream>& streams);
  // It is this component that sends the message.
  void set_component(uint32_t id, uint8_t component);

  void heard(uint32_t id, int64_t now_ns);
  void acknowledged(uint8_t result, int64_t now_ns);

  // The request to send now, if any; its target_system is left to the caller.
  std::optional<CommandLong> ask(int64_t now_ns);

  // Of any message, over the last 2 to 4 seconds; 0 when it does not come.
  double rate_hz(uint32_t id, int64_t now_ns) const;
  // Of those wanted, the ones the autopilot said it does not have.
  bool refused(uint32_t id) const;
  const std::vector<WantedStream>& wanted() const { return wanted_; }

 private:
  struct Meter {
    int64_t window_ns = 0;  // its begin
    int count = 0;          // since then
    double rate_hz = 0;     // of the window before
    int64_t last_ns = 0;
  };
  struct Request {
    int tries = 0;
    int64_t next_ns = 0;
    bool refused = false;
  };

  std::vector<WantedStream> wanted_;
  std::map<uint32_t, Request> requests_;
  std::map<uint32_t, Meter> meters_;
  std::optional<uint32_t> under_way_;  // the stream whose answer is awaited
  int64_t asked_ns_ = 0;
};

}  // namespace perch::mavlink
