#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>

namespace perch {

// Who may look. Without a token: whoever is on this machine, under a name that only this machine answers to.
// With one: who has shown it at the log-in and been given a session, a random cookie.
//
// No clock: time comes in. One thread at a time.
class Gate {
 public:
  explicit Gate(std::string token);

  bool needs_token() const { return !token_.empty(); }

  // A page of a stranger's that a browser here shows can make the browser ask us under the stranger's own
  // name (DNS rebinding). Without a token only names count that no stranger can own: IP addresses, localhost,
  // NAME.local. `host` is the header's value, with a port or not.
  bool trusts_host(std::string_view host) const;
  // A WebSocket or a form of another site's is not for us: Origin has to be http(s):// and the Host.
  static bool same_origin(std::string_view origin, std::string_view host);

  // The value of the Cookie header. Constant time in what the session's secret is.
  bool admits(std::string_view cookies, int64_t now_ns) const;

  enum class LogIn { kWelcome, kWrong, kTooOften };
  struct LogInResult {
    LogIn outcome = LogIn::kWrong;
    std::string session;  // with kWelcome: the cookie's value
  };
  // Ten wrong tokens a minute, of all who try; whoever has a session is not concerned.
  LogInResult log_in(std::string_view token, int64_t now_ns);

  static constexpr const char* kCookie = "perch_session";
  static constexpr int64_t kSessionSeconds = 12 * 3600;  // a day in the field
  static constexpr size_t kMostSessions = 64;            // the oldest goes
  static constexpr size_t kMostAttempts = 10;            // a minute

 private:
  struct Session {
    std::string secret;
    int64_t until_ns;
  };
  const std::string token_;
  std::deque<Session> sessions_;
  std::deque<int64_t> wrong_ns_;
};

// Whether both are the same, in a time that tells nothing of where they differ.
bool equal_in_constant_time(std::string_view a, std::string_view b);

// 32 random hexadecimal digits of the kernel's.
std::string random_secret();

}  // namespace perch
