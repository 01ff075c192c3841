#include "perch/station/gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perch/station/http_reply.h"

namespace perch {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr char kToken[] = "correct-horse-battery";
constexpr int64_t kSecond = 1'000'000'000;

HttpQuestion form(std::string_view body, std::string_view origin = "http://drone:8080") {
  HttpQuestion question;
  question.method = "POST";
  question.target = "/login";
  question.host = "drone:8080";
  question.origin = origin;
  question.content_type = "application/x-www-form-urlencoded";
  question.body = body;
  return question;
}
HttpQuestion get(std::string_view target, std::string_view host, std::string_view cookie = {}) {
  HttpQuestion question;
  question.method = "GET";
  question.target = target;
  question.host = host;
  question.cookie = cookie;
  return question;
}
std::string header(const HttpReply& reply, const std::string& name) {
  for (const auto& [key, value] : reply.headers)
    if (key == name) return value;
  return {};
}

TEST(Gate, WithoutATokenTrustsOnlyNamesNoStrangerCanOwn) {
  const Gate gate("");
  for (const char* host : {"127.0.0.1:8080", "localhost", "localhost:1", "[::1]:8080", "drone.local:8080"})
    EXPECT_TRUE(gate.trusts_host(host)) << host;
  for (const char* host : {"", "evil.example:8080", "127.0.0.1.evil.example", "localhost.evil.example",
                           "evil.example.local", ".local", "[::1", "local"})
    EXPECT_FALSE(gate.trusts_host(host)) << host;
}

TEST(Gate, TakesOnlyItsOwnOrigin) {
  EXPECT_TRUE(Gate::same_origin("http://drone:8080", "drone:8080"));
  EXPECT_TRUE(Gate::same_origin("https://drone", "drone"));
  for (const char* origin : {"", "null", "http://evil.example", "http://drone:8081",
                             "http://drone:8080.evil.example", "drone:8080", "file://drone:8080"})
    EXPECT_FALSE(Gate::same_origin(origin, "drone:8080")) << origin;
  EXPECT_FALSE(Gate::same_origin("http://", ""));
}

TEST(Gate, GivesASessionForTheTokenThatEndsInTime) {
  Gate gate(kToken);
  EXPECT_FALSE(gate.admits("", 0));
  EXPECT_EQ(gate.log_in("wrong", 0).outcome, Gate::LogIn::kWrong);
  const auto session = gate.log_in(kToken, 0);
  ASSERT_EQ(session.outcome, Gate::LogIn::kWelcome);
  const std::string cookie = "a=b; perch_session=" + session.session;
  EXPECT_TRUE(gate.admits(cookie, kSecond));
  EXPECT_FALSE(gate.admits(cookie, Gate::kSessionSeconds * kSecond));
  EXPECT_FALSE(gate.admits("perch_session=", 0));
  EXPECT_FALSE(gate.admits("xperch_session=" + session.session, 0));
  EXPECT_NE(gate.log_in(kToken, 0).session, session.session);
}

TEST(Gate, IsTriedTenTimesAMinuteAtMost) {
  Gate gate(kToken);
  for (size_t i = 0; i < Gate::kMostAttempts; ++i)
    EXPECT_EQ(gate.log_in("no", 0).outcome, Gate::LogIn::kWrong);
  EXPECT_EQ(gate.log_in(kToken, 0).outcome, Gate::LogIn::kTooOften);
  EXPECT_EQ(gate.log_in(kToken, 61 * kSecond).outcome, Gate::LogIn::kWelcome);
}

TEST(HttpReply, LogsInByAFormOfItsOwnAlone) {
  Gate gate(kToken);
  HttpReply reply = reply_to(form("token=correct%2Dhorse-battery"), gate, 0);
  EXPECT_EQ(reply.status, 303);
  EXPECT_EQ(header(reply, "Location"), "/");
  EXPECT_THAT(
      header(reply, "Set-Cookie"),
      testing::MatchesRegex("perch_session=[0-9a-f]{32}; Path=/; HttpOnly; SameSite=Strict; Max-Age=43200"));
  for (const char* body : {"token=wrong", "", "token=", "token=%", "token=%zz", "x=correct-horse-battery"}) {
    Gate fresh(kToken);
    reply = reply_to(form(body), fresh, 0);
    EXPECT_EQ(header(reply, "Location"), "/login.html#wrong") << body;
    EXPECT_EQ(header(reply, "Set-Cookie"), "") << body;
  }
  EXPECT_EQ(reply_to(form("token=correct-horse-battery", "http://evil.example"), gate, 0).status, 403);
  EXPECT_EQ(reply_to(form("token=correct-horse-battery", ""), gate, 0).status, 403);
}

TEST(HttpReply, ShowsWithoutASessionTheLogInAndNoMore) {
  Gate gate(kToken);
  EXPECT_EQ(header(reply_to(get("/", "drone:8080"), gate, 0), "Location"), "/login.html");
  EXPECT_EQ(reply_to(get("/login.html", "drone:8080"), gate, 0).status, 200);
  EXPECT_EQ(reply_to(get("/station.js", "drone:8080"), gate, 0).status, 401);
  EXPECT_EQ(reply_to(get("/nothing", "drone:8080"), gate, 0).status, 401);
  // A token in an address would be in logs and histories: it opens nothing.
  EXPECT_EQ(reply_to(get("/station.js?token=correct-horse-battery", "drone:8080"), gate, 0).status, 401);
  const std::string cookie = "perch_session=" + gate.log_in(kToken, 0).session;
  EXPECT_EQ(reply_to(get("/station.js", "drone:8080", cookie), gate, 0).status, 200);
}

TEST(HttpReply, ServesItsOwnFilesAndNoPathLeadsElsewhere) {
  Gate gate("");
  const HttpReply page = reply_to(get("/", "localhost:8080"), gate, 0);
  EXPECT_EQ(page.status, 200);
  EXPECT_THAT(header(page, "Content-Security-Policy"), StartsWith("default-src 'none'; script-src 'self';"));
  EXPECT_EQ(header(page, "X-Content-Type-Options"), "nosniff");
  for (const char* path :
       {"/../etc/passwd", "/%2e%2e/etc/passwd", "//etc/passwd", "/./index.html", "/index.html/..",
        "etc/passwd", "http://localhost/index.html", "/INDEX.HTML", "/index.html%00", "", "*"})
    EXPECT_EQ(reply_to(get(path, "localhost:8080"), gate, 0).status, 404) << path;
  EXPECT_EQ(reply_to(get("/", "evil.example"), gate, 0).status, 403);
  HttpQuestion put = get("/index.html", "localhost");
  put.method = "PUT";
  EXPECT_EQ(reply_to(put, gate, 0).status, 405);
  HttpQuestion again = get("/index.html", "localhost");
  const std::string etag = header(page, "ETag");
  again.if_none_match = etag;
  EXPECT_EQ(reply_to(again, gate, 0).status, 304);
}

}  // namespace
}  // namespace perch
