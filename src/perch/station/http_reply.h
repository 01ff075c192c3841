#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "perch/station/gate.h"

namespace perch {

// What counts of a request.
struct HttpQuestion {
  std::string_view method, target, host, origin, cookie, content_type, if_none_match, body;
};

struct HttpReply {
  int status = 200;
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  std::string_view asset;  // or this, which lives as long as the program
};

// Every answer but that of the WebSocket:
//   GET, HEAD   the files of the page; with a token only for those with a session, the others are led to
//   /login POST /login the form's token; a session's cookie for it
// A pure function but for the gate's sessions.
HttpReply reply_to(const HttpQuestion& question, Gate& gate, int64_t now_ns);

// The status with which a WebSocket of this origin and cookie is refused; 0: welcome.
int refusal_of_socket(const HttpQuestion& question, const Gate& gate, int64_t now_ns);

inline constexpr std::string_view kSocketPath = "/live";

}  // namespace perch
