#include "perch/links/mavlink/time_sync.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/rng.h"

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;

// An autopilot's clock behind a way that is now quick, now slow.
struct World {
  explicit World(unsigned seed = 0) : rng(seed) {}

  int64_t remote(int64_t local) const {
    return local + offset_ns + std::llround(skew * static_cast<double>(local - start_ns));
  }
  int64_t way(double base_ms, double jitter_ms) {
    double ms = base_ms - jitter_ms * std::log(1 - rng.uniform(0, 1));
    if (rng.uniform(0, 1) < spikes) ms += rng.uniform(0, 80);
    return static_cast<int64_t>(ms * 1e6);
  }
  // Runs the exchange for some seconds of our clock, 5 ms a step.
  void run(TimeSync& sync, double seconds, bool answers = true) {
    for (const int64_t end = now_ns + static_cast<int64_t>(seconds * 1e9); now_ns < end; now_ns += 5 * kMs) {
      const auto question = sync.ask(now_ns);
      if (!question || !answers || rng.uniform(0, 1) < loss) continue;
      const int64_t at_remote = now_ns + way(there_ms, jitter_there_ms);
      const int64_t back = at_remote + way(back_ms, jitter_back_ms);
      Timesync reply;
      reply.tc1 = remote(at_remote);
      reply.ts1 = question->ts1;
      EXPECT_FALSE(sync.receive(reply, back));
    }
  }
  double error_ns(const TimeSync& sync) const {
    const auto clock = sync.estimate(now_ns);
    return clock ? static_cast<double>(clock->offset_ns - (remote(now_ns) - now_ns)) : NAN;
  }
  double sigma_ns(const TimeSync& sync) const { return static_cast<double>(sync.estimate(now_ns)->sigma_ns); }

  TestRng rng;
  int64_t start_ns = 123 * kSecond, now_ns = 123 * kSecond;
  int64_t offset_ns = -100 * kSecond;
  double skew = 50e-6;
  double there_ms = 1, back_ms = 1, jitter_there_ms = 1, jitter_back_ms = 1;
  double spikes = 0, loss = 0;
};

TEST(TimeSync, KnowsNothingBeforeThreeAnswers) {
  TimeSync sync;
  World world;
  EXPECT_FALSE(sync.estimate(world.now_ns));
  EXPECT_FALSE(sync.local_from_boot_ms(5, world.now_ns));
  world.run(sync, 0.15);
  EXPECT_FALSE(sync.estimate(world.now_ns));
  world.run(sync, 0.1);
  EXPECT_TRUE(sync.estimate(world.now_ns));
}

TEST(TimeSync, FindsOffsetAndDriftThroughJitter) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    TimeSync sync;
    World world(seed);
    world.run(sync, 3);
    // The quickest of 20 exchanges with 1 ms of jitter each way waits some tenths of a ms.
    EXPECT_LT(std::abs(world.error_ns(sync)), 0.5 * kMs) << seed;
    world.run(sync, 60);
    EXPECT_LT(std::abs(world.error_ns(sync)), 0.25 * kMs) << seed;
    // 0.1 ms over a minute is 2 ppm.
    EXPECT_NEAR(sync.estimate(world.now_ns)->skew, world.skew, 6e-6) << seed;
  }
}

TEST(TimeSync, ErrorsAreWithinWhatItClaims) {
  int beyond = 0, count = 0;
  double sum = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    TimeSync sync;
    World world(seed);
    world.there_ms = world.rng.uniform(0.1, 4);  // lopsided, as far as it may be
    world.back_ms = world.rng.uniform(0.1, 4);
    world.jitter_there_ms = world.rng.uniform(0, 4);
    world.jitter_back_ms = world.rng.uniform(0, 4);
    world.spikes = 0.1;
    world.loss = 0.2;
    world.skew = world.rng.normal(5e-5);
    for (int second = 1; second <= 40; second *= 3) {
      world.run(sync, second);
      const double z = world.error_ns(sync) / world.sigma_ns(sync);
      sum += z * z;
      ++count;
      beyond += !(std::abs(z) < 3);
    }
  }
  EXPECT_EQ(beyond, 0);
  // Not much too careful either: the claim holds the worst split of the round trip, the truth a random one.
  EXPECT_GT(std::sqrt(sum / count), 0.3);
  EXPECT_LT(std::sqrt(sum / count), 1.2);
}

TEST(TimeSync, AStepOfTheRemoteClockIsNoticedAtOnceAndCounted) {
  for (const int64_t step : {-22 * kSecond, 3600 * kSecond, 40 * kMs, -40 * kMs}) {
    TimeSync sync;
    World world;
    world.run(sync, 20);
    world.offset_ns += step;
    world.run(sync, 2);  // three questions at 2 Hz and some more
    EXPECT_EQ(sync.statistics().steps, 1u) << step;
    EXPECT_LT(std::abs(world.error_ns(sync)), 2.0 * kMs) << step;
    world.run(sync, 20);
    EXPECT_LT(std::abs(world.error_ns(sync)), 0.5 * kMs) << step;
    EXPECT_EQ(sync.statistics().steps, 1u) << step;
    EXPECT_EQ(sync.statistics().outliers, 0u) << step;
  }
}

TEST(TimeSync, AStepOfLatencyIsNoStepOfTheClock) {
  TimeSync sync;
  World world;
  world.run(sync, 20);
  world.there_ms = 60;  // a radio got into trouble
  world.run(sync, 20);
  EXPECT_EQ(sync.statistics().steps, 0u);
  EXPECT_LT(std::abs(world.error_ns(sync)), 3 * world.sigma_ns(sync));
}

TEST(TimeSync, OneFalseAnswerChangesNothing) {
  for (const int64_t lie : {int64_t{1}, int64_t{-1}, INT64_MAX, INT64_MIN, 50 * kSecond}) {
    TimeSync sync;
    World world;
    world.run(sync, 10);
    const double before = world.error_ns(sync);
    std::optional<Timesync> question;
    while (!question) question = sync.ask(world.now_ns += 5 * kMs);
    Timesync reply;
    reply.tc1 = lie;
    reply.ts1 = question->ts1;
    sync.receive(reply, world.now_ns + kMs);
    EXPECT_NEAR(world.error_ns(sync), before, 0.05 * kMs) << lie;
    EXPECT_EQ(sync.statistics().outliers, 1u) << lie;
    world.run(sync, 5);
    EXPECT_EQ(sync.statistics().steps, 0u);
  }
}

TEST(TimeSync, AnswersWithoutAMeaningMakeNoClockAndNoHarm) {
  TestRng rng;
  for (int round = 0; round < 200; ++round) {
    TimeSync sync;
    int64_t now = rng.index(1'000'000'000);
    for (int i = 0; i < 100; ++i) {
      now += 100 * kMs;
      const auto question = sync.ask(now);
      if (!question) continue;
      Timesync reply;
      reply.tc1 = static_cast<int64_t>(rng.uniform(-9.2e18, 9.2e18)) >> (round % 8 * 8);
      reply.ts1 = question->ts1;
      sync.receive(reply, now + rng.index(20'000'000));
      sync.estimate(now + static_cast<int64_t>(rng.uniform(0, 1e12)));
      sync.local_from_remote(static_cast<int64_t>(rng.uniform(-9.2e18, 9.2e18)), now);
      sync.local_from_boot_ms(static_cast<uint32_t>(rng.uniform(0, 4e9)), now);
    }
  }
}

TEST(TimeSync, AnswersToOthersAndAnswersTwiceDoNotCount) {
  TimeSync sync;
  World world;
  world.run(sync, 5);
  const uint64_t heard = sync.statistics().heard;
  Timesync foreign;
  foreign.tc1 = world.remote(world.now_ns);
  for (const int64_t ts1 : {int64_t{0}, int64_t{5}, world.now_ns, INT64_MIN}) {
    foreign.ts1 = ts1;
    EXPECT_FALSE(sync.receive(foreign, world.now_ns));
  }
  std::optional<Timesync> question;
  while (!question) question = sync.ask(world.now_ns += 5 * kMs);
  foreign.ts1 = question->ts1;
  foreign.tc1 = world.remote(world.now_ns);
  sync.receive(foreign, world.now_ns + kMs);
  sync.receive(foreign, world.now_ns + kMs);
  EXPECT_EQ(sync.statistics().heard, heard + 1);
  EXPECT_EQ(sync.statistics().foreign, 5u);
}

TEST(TimeSync, AQuestionIsAnsweredWithOurTimeAndItsOwn) {
  TimeSync sync;
  Timesync question;
  question.ts1 = 987;
  const auto reply = sync.receive(question, 123'456'789);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->tc1, 123'456'789);
  EXPECT_EQ(reply->ts1, 987);
}

TEST(TimeSync, InSilenceItGrowsUnsureAndThenSaysNothing) {
  TimeSync sync;
  World world;
  world.run(sync, 60);
  const double sigma = world.sigma_ns(sync);
  world.run(sync, 60, false);
  EXPECT_GT(world.sigma_ns(sync), sigma);
  EXPECT_LT(std::abs(world.error_ns(sync)), 3 * world.sigma_ns(sync));
  world.run(sync, 36'000, false);
  EXPECT_FALSE(sync.estimate(world.now_ns));
}

TEST(TimeSync, MapsStampsOfTheRemoteClockToOurs) {
  TimeSync sync;
  World world;
  world.offset_ns = -world.start_ns + (int64_t{1} << 32) * kMs - 20 * kSecond;  // its ms wrap 20 s from now
  world.run(sync, 19);
  for (const int64_t ago_ms : {0, 10, 500, 3000}) {
    const int64_t then = world.now_ns - ago_ms * kMs;
    EXPECT_NEAR(static_cast<double>(*sync.local_from_remote(world.remote(then), world.now_ns) - then), 0,
                0.5 * kMs);
  }
  // Through the wrap, and with the half ms put back that whole ms lose: on the average of many.
  double sum = 0;
  constexpr int kCount = 300;
  for (int i = 0; i < kCount; ++i) {
    world.run(sync, 0.01);
    const int64_t then = world.now_ns - world.rng.index(10'000'000);
    const auto stamp = static_cast<uint32_t>(world.remote(then) / kMs);
    const auto mapped = sync.local_from_boot_ms(stamp, world.now_ns);
    ASSERT_TRUE(mapped);
    const double error = static_cast<double>(*mapped - then) - world.error_ns(sync) * -1;
    EXPECT_LT(std::abs(error), 0.51 * kMs);
    sum += error;
  }
  // Even over +- 0.5 ms, of 300: 0.29 / sqrt(300) = 0.017 ms; four sigma.
  EXPECT_LT(std::abs(sum / kCount), 0.07 * kMs);
}

TEST(TimeSync, AnotherAutopilotStartsFromNothing) {
  TimeSync sync;
  World world;
  world.run(sync, 5);
  sync.restart();
  EXPECT_FALSE(sync.estimate(world.now_ns));
  world.offset_ns += 77 * kSecond;
  world.run(sync, 5);
  EXPECT_LT(std::abs(world.error_ns(sync)), 0.5 * kMs);
  EXPECT_EQ(sync.statistics().steps, 0u);
}

}  // namespace
}  // namespace perch::mavlink
