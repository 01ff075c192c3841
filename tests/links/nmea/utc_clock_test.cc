#include "perch/links/nmea/utc_clock.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/rng.h"

namespace perch::nmea {
namespace {

constexpr int64_t kMs = 1'000'000, kSecond = 1000 * kMs, kDay = 86'400 * kSecond;

// A receiver's clock, which is exact, and ours, which is off by `skew`; what it says takes 60 ms and a queue.
struct World {
  double skew = 50e-6;
  int64_t utc_ns = 3600 * kSecond;
  int64_t ours_minus_utc = -3000 * kSecond;

  int64_t ours(int64_t utc) const {
    return utc + ours_minus_utc + std::llround(skew * static_cast<double>(utc - 3600 * kSecond));
  }
};

TEST(UtcClock, TheQuickestSentenceTells) {
  TestRng rng;
  World world;
  UtcClock clock;
  double worst = 0;
  for (int i = 0; i < 3000; ++i, world.utc_ns += 100 * kMs) {
    const int64_t now =
        world.ours(world.utc_ns) + 60 * kMs + static_cast<int64_t>(-20e6 * std::log(1 - rng.uniform(0, 1)));
    const bool fits = clock.take(world.utc_ns % kDay, now);
    EXPECT_EQ(fits, i >= 2);
    if (i < 100) continue;
    const auto local = clock.local_from_utc(world.utc_ns % kDay, now);
    ASSERT_TRUE(local);
    worst = std::max(worst, std::abs(1e-6 * static_cast<double>(*local - world.ours(world.utc_ns)) - 60));
  }
  // Of 300 in half a minute, of a mean of 20 ms, the quickest is 0.07 ms late on the average; the drift over
  // half a minute is 1.5 ms.
  EXPECT_LT(worst, 2.5);
  EXPECT_NEAR(static_cast<double>(*clock.median_lateness_ns(world.ours(world.utc_ns))), 14e6,
              3e6);  // 20 ms ln 2
  EXPECT_EQ(clock.steps(), 0u);
  EXPECT_FALSE(clock.local_from_utc(0, world.ours(world.utc_ns) + 11 * kSecond));
}

TEST(UtcClock, MidnightIsNoStep) {
  World world;
  world.utc_ns = kDay - 5 * kSecond;
  UtcClock clock;
  for (int i = 0; i < 200; ++i, world.utc_ns += 100 * kMs) {
    const int64_t now = world.ours(world.utc_ns) + 60 * kMs;
    clock.take(world.utc_ns % kDay, now);
    if (i < 3) continue;
    const auto local = clock.local_from_utc(world.utc_ns % kDay, now);
    ASSERT_TRUE(local);
    EXPECT_LT(std::abs(*local - world.ours(world.utc_ns) - 60 * kMs), kMs);
  }
  EXPECT_EQ(clock.steps(), 0u);
}

TEST(UtcClock, OneWrongTimeIsNotBelievedAndThreeAreAStep) {
  for (const int64_t step : {18 * kSecond, -18 * kSecond, -200 * kMs, 2 * kSecond, kDay / 2 - kSecond}) {
    World world;
    UtcClock clock;
    const auto say = [&](int64_t wrong_by) {
      world.utc_ns += 100 * kMs;
      const int64_t of_day = ((world.utc_ns - wrong_by) % kDay + kDay) % kDay;
      return clock.take(of_day, world.ours(world.utc_ns) + 60 * kMs);
    };
    for (int i = 0; i < 50; ++i) say(0);
    EXPECT_FALSE(say(step)) << step;
    EXPECT_TRUE(say(0));
    EXPECT_FALSE(say(step));
    EXPECT_FALSE(say(step));
    EXPECT_TRUE(say(0));
    EXPECT_EQ(clock.steps(), 0u);
    EXPECT_FALSE(say(step));
    EXPECT_FALSE(say(step + 5 * kSecond));  // garbage does not agree with itself
    EXPECT_FALSE(say(step - 5 * kSecond));
    EXPECT_EQ(clock.steps(), 0u) << step;
    // One that makes all late may be a line that catches up.
    for (int i = 0; i < (step > 0 ? 102 : 3); ++i) say(step);
    EXPECT_EQ(clock.steps(), 1u) << step;
    const int64_t now = world.ours(world.utc_ns) + 60 * kMs;
    const auto local = clock.local_from_utc(((world.utc_ns - step) % kDay + kDay) % kDay, now);
    ASSERT_TRUE(local);
    EXPECT_LT(std::abs(*local - now), kMs) << step;
  }
}

// 2 s without a sentence, then all of them at the line's rate: each is placed where it belongs or refused.
TEST(UtcClock, ALineThatCatchesUpIsNoStep) {
  World world;
  UtcClock clock;
  for (int i = 0; i < 500; ++i, world.utc_ns += 20 * kMs)
    clock.take(world.utc_ns, world.ours(world.utc_ns) + 60 * kMs);
  int64_t now = world.ours(world.utc_ns) + 2 * kSecond;
  int refused = 0;
  for (; now > world.ours(world.utc_ns) + 60 * kMs; world.utc_ns += 20 * kMs, now += 13 * kMs) {
    refused += !clock.take(world.utc_ns, now);
    const auto local = clock.local_from_utc(world.utc_ns, now);
    ASSERT_TRUE(local);
    EXPECT_LT(std::abs(*local - world.ours(world.utc_ns) - 60 * kMs), kMs);
  }
  EXPECT_GT(refused, 100);
  EXPECT_EQ(clock.steps(), 0u);
}

TEST(UtcClock, WhatHadWaitedInABufferDoesNotCount) {
  World world;
  UtcClock clock;
  const int64_t opened = world.ours(world.utc_ns + 3 * kSecond);
  for (int i = 0; i < 30; ++i, world.utc_ns += 100 * kMs) clock.take(world.utc_ns, opened);  // all at once
  for (int i = 0; i < 10; ++i, world.utc_ns += 100 * kMs)
    clock.take(world.utc_ns, world.ours(world.utc_ns) + 60 * kMs);
  const auto local = clock.local_from_utc(world.utc_ns, world.ours(world.utc_ns));
  ASSERT_TRUE(local);
  EXPECT_NEAR(static_cast<double>(*local - world.ours(world.utc_ns)), 60e6, 1e6);
}

}  // namespace
}  // namespace perch::nmea
