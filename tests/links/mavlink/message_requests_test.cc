#include "perch/links/mavlink/message_requests.h"

#include <gtest/gtest.h>

#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000, kSecond = 1000 * kMs;
constexpr uint32_t kA = Attitude::kId, kP = LocalPositionNed::kId, kT = SystemTime::kId;

class Requests : public testing::Test {
 protected:
  Requests() { requests_.want({{kA, 20}, {kP, 10}, {kT, 1}}); }
  // The id that is asked for at this moment; 0 for nothing.
  uint32_t ask(int64_t ms) {
    const auto command = requests_.ask(ms * kMs);
    if (!command) return 0;
    EXPECT_EQ(command->command, mav_command::kRequestMessage);
    return static_cast<uint32_t>(command->param1);
  }
  std::optional<MessageExchange> hear(uint32_t id, int64_t ms) { return requests_.heard(id, ms * kMs); }
  // Answers within 10 ms whatever is asked, for so long.
  void answer_all(int64_t from_ms, int64_t to_ms) {
    for (int64_t t = from_ms; t < to_ms; t += 5) {
      const uint32_t id = ask(t);
      ASSERT_TRUE(id == 0 || hear(id, t + 4));
    }
  }
  MessageRequests requests_;
};

TEST_F(Requests, OneAtATimeAndEachAtItsRate) {
  EXPECT_EQ(ask(1000), kA);
  EXPECT_EQ(ask(1005), 0u);
  const auto exchange = hear(kA, 1012);
  ASSERT_TRUE(exchange);
  EXPECT_EQ(exchange->sent_ns, 1000 * kMs);
  EXPECT_EQ(exchange->round_trip_ns(), 12 * kMs);
  EXPECT_EQ(ask(1012), kP);
  hear(kP, 1020);
  EXPECT_EQ(ask(1020), kT);
  hear(kT, 1030);
  EXPECT_EQ(ask(1030), 0u);
  EXPECT_EQ(ask(1050), kA);
  hear(kA, 1055);
  const uint64_t before = requests_.statistics().asked;
  answer_all(1060, 3060);
  EXPECT_NEAR(static_cast<double>(requests_.statistics().asked - before), 2 * (20 + 10 + 1), 3);
}

TEST_F(Requests, AnAnswerThatNobodyAwaitsIsNone) {
  EXPECT_FALSE(hear(kA, 1000));
  ask(1000);
  EXPECT_FALSE(hear(kP, 1005));
  EXPECT_TRUE(hear(kA, 1010));
  EXPECT_FALSE(hear(kA, 1011));  // twice
  EXPECT_FALSE(hear(4711, 1012));
}

TEST_F(Requests, ALateAnswerIsNotTakenForThatToALaterQuestion) {
  answer_all(1000, 2000);
  // Nothing comes; after the time-out (50 ms) another message is asked for, and not that one before it is
  // answered.
  const uint32_t lost = ask(2000);
  ASSERT_NE(lost, 0u);
  EXPECT_EQ(requests_.time_out_ns(), 50 * kMs);
  const uint32_t other = ask(2051);
  ASSERT_NE(other, 0u);
  ASSERT_NE(other, lost);
  EXPECT_FALSE(hear(lost, 2060));  // late: known as such
  EXPECT_TRUE(hear(other, 2065));
  // Now it is settled, and asked for again when it is due.
  uint32_t next = 0;
  for (int64_t t = 2066; t < 2400 && next != lost; t += 5) {
    next = ask(t);
    if (next) hear(next, t + 4);
  }
  EXPECT_EQ(next, lost);
}

TEST_F(Requests, WhereAllAreInDoubtASecondSettlesThem) {
  answer_all(1000, 2000);
  int64_t last = 0;
  std::map<uint32_t, int64_t> asked;
  for (int64_t t = 2000; t < 8000; ++t) {
    const uint32_t id = ask(t);
    if (!id) continue;
    EXPECT_TRUE(!asked.count(id) || t - asked[id] > 1000) << id;
    asked[id] = last = t;
  }
  EXPECT_EQ(asked.size(), 3u);
  EXPECT_GT(last, 6000);  // it never gives up
}

TEST_F(Requests, TheTimeOutFollowsTheLine) {
  EXPECT_EQ(requests_.time_out_ns(), 500 * kMs);
  const uint32_t id = ask(1000);
  hear(id, 1090);
  EXPECT_EQ(requests_.time_out_ns(), 270 * kMs);
  ask(1100);
  ask(1371);  // timed out: twice as long from now on
  EXPECT_EQ(requests_.time_out_ns(), 500 * kMs);
  EXPECT_EQ(requests_.statistics().timed_out, 1u);
}

TEST_F(Requests, WhatIsRefusedIsLeftInPeace) {
  ASSERT_EQ(ask(1000), kA);
  requests_.acknowledged(mav_result::kAccepted, 1004 * kMs);
  EXPECT_EQ(ask(1005), 0u);  // it will come
  requests_.acknowledged(mav_result::kUnsupported, 1006 * kMs);
  EXPECT_EQ(ask(1007), kP);
  hear(kP, 1010);
  int attitudes = 0;
  for (int64_t t = 1010; t < 60'000; t += 5) {
    const uint32_t id = ask(t);
    attitudes += id == kA;
    if (id) hear(id, t + 4);
  }
  EXPECT_EQ(attitudes, 0);
  // What has been answered before is known there: the refusal was of another question, and late.
  const uint32_t id = ask(61'010);
  ASSERT_NE(id, 0u);
  if (id != kA) {
    requests_.acknowledged(mav_result::kUnsupported, 61'012 * kMs);
    EXPECT_TRUE(hear(id, 61'015));
  }
}

}  // namespace
}  // namespace perch::mavlink
