#include "perch/station/http_reply.h"

#include <algorithm>

#include "perch/station/assets.h"

namespace perch {
namespace {

// The browser itself is told that the page may load nothing from elsewhere, and nobody may frame it.
constexpr std::pair<const char*, const char*> kAlways[] = {
    {"Content-Security-Policy",
     "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src "
     "'self'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'"},
    {"X-Content-Type-Options", "nosniff"},
    {"X-Frame-Options", "DENY"},
    // "no-referrer" would have browsers send the log-in form itself with "Origin: null".
    {"Referrer-Policy", "same-origin"},
    {"Cross-Origin-Opener-Policy", "same-origin"},
    {"Cross-Origin-Resource-Policy", "same-origin"}};

HttpReply plain(int status, std::string text) {
  HttpReply reply{status,
                  {{"Content-Type", "text/plain; charset=utf-8"}, {"Cache-Control", "no-store"}},
                  std::move(text) + "\n",
                  {}};
  return reply;
}

HttpReply led_to(const std::string& place) {
  return {303, {{"Location", place}, {"Cache-Control", "no-store"}}, {}, {}};
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// The value of "token=..." in a form, decoded; empty when it is none.
std::string form_token(std::string_view body) {
  constexpr std::string_view kName = "token=";
  if (!body.starts_with(kName)) return {};
  std::string value;
  for (size_t i = kName.size(); i < body.size() && body[i] != '&'; ++i) {
    if (body[i] == '+') {
      value += ' ';
    } else if (body[i] != '%') {
      value += body[i];
    } else {
      const int high = i + 2 < body.size() ? hex_digit(body[i + 1]) : -1;
      const int low = i + 2 < body.size() ? hex_digit(body[i + 2]) : -1;
      if (high < 0 || low < 0) return {};
      value += static_cast<char>(16 * high + low);
      i += 2;
    }
  }
  return value;
}

HttpReply log_in(const HttpQuestion& question, Gate& gate, int64_t now_ns) {
  if (!Gate::same_origin(question.origin, question.host)) return plain(403, "asked from another site");
  if (!question.content_type.starts_with("application/x-www-form-urlencoded"))
    return plain(415, "expected a form");
  const auto result = gate.log_in(form_token(question.body), now_ns);
  if (result.outcome == Gate::LogIn::kTooOften) {
    HttpReply reply = plain(429, "too many wrong tokens; wait a minute");
    reply.headers.emplace_back("Retry-After", "60");
    return reply;
  }
  if (result.outcome == Gate::LogIn::kWrong) return led_to("/login.html#wrong");
  HttpReply reply = led_to("/");
  reply.headers.emplace_back("Set-Cookie", std::string(Gate::kCookie) + "=" + result.session +
                                               "; Path=/; HttpOnly; SameSite=Strict; Max-Age=" +
                                               std::to_string(Gate::kSessionSeconds));
  return reply;
}

HttpReply asset_of(const HttpQuestion& question, const Gate& gate, int64_t now_ns) {
  std::string_view path = question.target.substr(0, question.target.find('?'));
  if (path == "/") path = "/index.html";
  const auto assets = station_assets();
  const auto found =
      std::find_if(assets.begin(), assets.end(), [&](const Asset& a) { return a.path == path; });
  const bool admitted = gate.admits(question.cookie, now_ns);
  if (!admitted && (found == assets.end() || !found->open))
    return path == "/index.html" ? led_to("/login.html") : plain(401, "log in first");
  if (found == assets.end()) return plain(404, "nothing here");
  HttpReply reply{200,
                  {{"Content-Type", std::string(found->type)},
                   {"Content-Encoding", "gzip"},
                   {"ETag", std::string(found->etag)},
                   // Asked again each time, which a poor radio bears, and sent again only when it changed.
                   {"Cache-Control", "no-cache"}},
                  {},
                  found->gzip};
  if (question.if_none_match == found->etag) {
    reply.status = 304;
    reply.asset = {};
  }
  return reply;
}

HttpReply answer(const HttpQuestion& question, Gate& gate, int64_t now_ns) {
  if (!gate.trusts_host(question.host)) return plain(403, "asked under a name that is not this machine's");
  if (question.method == "POST" && question.target == "/login") return log_in(question, gate, now_ns);
  if (question.method == "GET" || question.method == "HEAD") return asset_of(question, gate, now_ns);
  HttpReply reply = plain(405, "expected GET");
  reply.headers.emplace_back("Allow", "GET, HEAD");
  return reply;
}

}  // namespace

HttpReply reply_to(const HttpQuestion& question, Gate& gate, int64_t now_ns) {
  HttpReply reply = answer(question, gate, now_ns);
  for (const auto& [name, value] : kAlways) reply.headers.emplace_back(name, value);
  return reply;
}

int refusal_of_socket(const HttpQuestion& question, const Gate& gate, int64_t now_ns) {
  if (question.target != kSocketPath) return 404;
  if (!gate.trusts_host(question.host)) return 403;
  if (!Gate::same_origin(question.origin, question.host)) return 403;
  return gate.admits(question.cookie, now_ns) ? 0 : 401;
}

}  // namespace perch
