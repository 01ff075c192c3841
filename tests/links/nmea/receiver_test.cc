#include "perch/links/nmea/receiver.h"

#include <gtest/gtest.h>

#include "links/nmea/fake_receiver.h"
#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch::nmea {
namespace {

constexpr int64_t kMs = 1'000'000, kSecond = 1000 * kMs;
constexpr int64_t kLatency = 40 * kMs;

// Flies an eight and swings about all axes. `t` in s.
ReceiverTruth flight(double t) {
  ReceiverTruth truth;
  truth.ned_from_body = {so3_exp({0.2 * std::sin(2 * t), 0.15 * std::sin(3 * t + 1), 0.5 * std::sin(t)}),
                         {5 * std::sin(t), 3 * std::sin(2 * t), -10 + std::cos(t)}};
  truth.body_velocity_in_ned = {5 * std::cos(t), 6 * std::cos(2 * t), -std::sin(t)};
  return truth;
}

// Ten epochs a second, attitude fifty times; each sentence arrives `latency` and what a queue adds later. Our
// clock is that of the flight.
struct World {
  explicit World(const ReceiverOptions& options = {}) : receiver(options) {}

  void run(double seconds) {
    for (const int64_t end = now_ns + std::llround(seconds * 1e9); now_ns < end; now_ns += 20 * kMs) {
      const ReceiverTruth truth = flight(1e-9 * static_cast<double>(now_ns));
      const int64_t of_day_ms = now_ns / kMs + 43'200'000;
      std::string all;
      if (now_ns % (100 * kMs) == 0) {
        if (gga) all += fake.gga(of_day_ms, truth);
        if (rmc) all += fake.rmc(of_day_ms, truth);
      }
      if (attitude) all += FakeReceiver::pashr(of_day_ms, truth);
      if (garble) all = garble(all);
      hear(all, now_ns + kLatency + static_cast<int64_t>(1e6 * rng.uniform(0, 3)));
      const auto complete = receiver.take_fixes(now_ns + kLatency + 4 * kMs);
      fixes.insert(fixes.end(), complete.begin(), complete.end());
    }
  }
  void hear(const std::string& text, int64_t arrival_ns) {
    receiver.receive({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, arrival_ns);
  }
  // Where the body of a fix is off, by the flight of its own time.
  double off(const PositionFix& fix) const {
    const ReceiverTruth truth = flight(1e-9 * static_cast<double>(fix.time_ns - kLatency));
    return (fix.body_in_ned - truth.ned_from_body.translation).norm();
  }

  TestRng rng;
  FakeReceiver fake;
  Receiver receiver;
  int64_t now_ns = 1000 * kSecond;
  bool gga = true, rmc = true, attitude = true;
  std::function<std::string(const std::string&)> garble;
  std::vector<PositionFix> fixes;
};

ReceiverOptions at_origin() { return {FakeReceiver{}.origin}; }

TEST(NmeaReceiver, TellsWhereTheBodyIsHowItMovesAndHowItLies) {
  World world(at_origin());
  world.run(20);
  ASSERT_GT(world.fixes.size(), 190u);
  for (const PositionFix& fix : world.fixes) {
    // The least of the queue's 0 to 3 ms was met within the first three sentences or soon after: 8 m/s times
    // 3 ms.
    EXPECT_LT(world.off(fix), 0.025);
    ASSERT_TRUE(fix.ned_from_body);
    const ReceiverTruth truth = flight(1e-9 * static_cast<double>(fix.time_ns - kLatency));
    // 1 rad/s times 3 ms.
    EXPECT_LT(fix.ned_from_body->angularDistance(truth.ned_from_body.rotation), 4e-3);
  }
  for (size_t i = 20; i < world.fixes.size(); ++i) {
    const ReceiverTruth truth = flight(1e-9 * static_cast<double>(world.fixes[i].time_ns - kLatency));
    const Eigen::Vector3d off = world.fixes[i].body_velocity_in_ned - truth.body_velocity_in_ned;
    EXPECT_LT(off.head<2>().norm(), 0.05);  // Doppler's: 12 m/s^2 times 3 ms
    EXPECT_LT(std::abs(off.z()), 0.06);     // half a period of 0.1 s at 1 m/s^2
  }
  EXPECT_EQ(world.receiver.quality(world.now_ns), FixQuality::kRtk);
  EXPECT_NEAR(world.receiver.fix_hz(world.now_ns), 10, 0.5);
  EXPECT_NEAR(world.receiver.attitude_hz(world.now_ns), 50, 2);
  EXPECT_EQ(world.receiver.statistics().jumps_refused,
            4u);  // two first ones each, which nothing had confirmed
  const auto between = world.receiver.history().attitude_at(world.now_ns - 111 * kMs + kLatency);
  ASSERT_TRUE(between);
  EXPECT_LT(between->ned_from_body.angularDistance(
                flight(1e-9 * static_cast<double>(world.now_ns - 111 * kMs)).ned_from_body.rotation),
            4e-3);
}

TEST(NmeaReceiver, TheFirstConfirmedFixIsTheOriginWhereNoneIsGiven) {
  World world;
  world.run(2);
  ASSERT_FALSE(world.fixes.empty());
  EXPECT_EQ(world.fixes.front().body_in_ned.norm(), 0);
  const PositionFix &a = world.fixes[3], b = world.fixes[9];
  const auto truth = [](const PositionFix& fix) {
    return flight(1e-9 * static_cast<double>(fix.time_ns - kLatency)).ned_from_body.translation;
  };
  EXPECT_LT((b.body_in_ned - a.body_in_ned - (truth(b) - truth(a))).norm(), 0.05);
}

TEST(NmeaReceiver, PositionsAloneHaveNoAttitude) {
  World world(at_origin());
  world.attitude = world.rmc = false;
  world.run(5);
  ASSERT_GT(world.fixes.size(), 40u);
  for (const PositionFix& fix : world.fixes) {
    EXPECT_FALSE(fix.ned_from_body);
    EXPECT_LT(world.off(fix), 0.025);
  }
  EXPECT_TRUE(world.receiver.take_attitudes().empty());
}

TEST(NmeaReceiver, WhatDoesNotComeIsNotWaitedForForEver) {
  World world(at_origin());
  world.run(5);
  const size_t before = world.fixes.size();
  world.attitude = world.rmc = false;  // the inertial unit fails
  world.run(5);
  EXPECT_NEAR(static_cast<double>(world.fixes.size() - before), 50, 4);
  EXPECT_FALSE(world.fixes.back().ned_from_body);
}

TEST(NmeaReceiver, AHeadingOfItsOwnCompletesAnAttitude) {
  World world(at_origin());
  world.attitude = false;
  for (int i = 0; i < 20; ++i) {
    world.run(0.1);
    world.hear(sentence_of("INHDT,90.0,T"), world.now_ns);
    world.hear(sentence_of("PSXN,23,5.00,-2.00,,0.0"), world.now_ns + kMs);
  }
  const auto* last = world.receiver.history().attitudes().latest();
  ASSERT_TRUE(last);
  const YawPitchRoll a = ypr_from_rotation(last->ned_from_body);
  EXPECT_NEAR(a.yaw * kDegFromRad, 90, 1e-6);
  EXPECT_NEAR(a.roll * kDegFromRad, 5, 1e-6);
  EXPECT_NEAR(a.pitch * kDegFromRad, -2, 1e-6);
  const uint64_t before = world.receiver.statistics().attitudes;
  world.hear(sentence_of("PSXN,23,5.00,-2.00,,0.0"), world.now_ns + 300 * kMs);  // the heading is old
  EXPECT_EQ(world.receiver.statistics().attitudes, before);
}

TEST(NmeaReceiver, ForTheFilterSixtyAttitudesASecondAtTheMost) {
  World world(at_origin());
  world.run(2);
  world.receiver.take_attitudes();
  world.run(1);
  const auto said = world.receiver.take_attitudes();
  EXPECT_NEAR(static_cast<double>(said.size()), 50, 2);
  for (size_t i = 1; i < said.size(); ++i) EXPECT_GT(said[i].timestamp_ns, said[i - 1].timestamp_ns);
  EXPECT_FALSE(said[0].body_velocity_in_world);
  EXPECT_FALSE(said[0].angular_velocity_in_body);
  EXPECT_EQ(said[0].attitude_sigma, 0.005);  // above the 0.1 degrees that it says
}

TEST(NmeaReceiver, ClaimsWhatIsToldAndElseWhatIsUsual) {
  World world(at_origin());
  world.run(1);
  auto accuracy = world.receiver.accuracy(world.now_ns);
  ASSERT_TRUE(accuracy);
  EXPECT_FALSE(accuracy->told);
  EXPECT_NEAR(accuracy->horizontal, 0.8 * 0.02 / std::sqrt(2), 1e-9);
  world.fake.quality = 1;
  world.run(1);
  EXPECT_NEAR(world.receiver.accuracy(world.now_ns)->horizontal, 0.8 * 4 / std::sqrt(2), 1e-9);
  world.hear(
      sentence_of("GNGST," + FakeReceiver::time_text(world.now_ns / kMs + 43'200'000) + ",1,,,,0.3,0.4,0.9"),
      world.now_ns + kLatency + kMs);
  accuracy = world.receiver.accuracy(world.now_ns);
  EXPECT_TRUE(accuracy->told);
  EXPECT_NEAR(accuracy->horizontal, 0.5 / std::sqrt(2), 1e-9);
  EXPECT_EQ(accuracy->vertical, 0.9);
  EXPECT_FALSE(world.receiver.accuracy(world.now_ns + 5 * kSecond));
}

TEST(NmeaReceiver, AFixThatIsLostIsSaidAndComesBack) {
  World world(at_origin());
  world.run(3);
  world.fake.quality = 0;
  world.run(1);
  EXPECT_EQ(world.receiver.quality(world.now_ns), FixQuality::kNone);
  EXPECT_EQ(world.receiver.statistics().no_fix, 10u);
  world.fake.quality = 5;
  world.run(1);
  EXPECT_EQ(world.receiver.quality(world.now_ns), FixQuality::kRtkFloat);
}

TEST(NmeaReceiver, AJumpHasToBeConfirmed) {
  World world(at_origin());
  world.run(3);
  const Geodetic home = world.fake.origin;
  world.fake.origin.latitude += 1e-5;  // 64 m
  world.run(0.2);
  for (const PositionFix& fix : world.fixes) EXPECT_LT(world.off(fix), 0.025);
  world.fake.origin = home;
  world.run(1);
  for (const PositionFix& fix : world.fixes) EXPECT_LT(world.off(fix), 0.025);
  world.fake.origin.latitude += 1e-5;
  world.run(0.6);
  EXPECT_NEAR(world.off(world.fixes.back()), 63.7, 0.5);
}

TEST(NmeaReceiver, LeapSecondsThatComeLateAreAStepAfterWhichAllIsRight) {
  World world(at_origin());
  world.run(3);
  world.fixes.clear();
  world.now_ns += 0;
  FakeReceiver& fake = world.fake;
  // From now on it says times that are 18 s earlier, of the same moments.
  const auto say = [&](int64_t ns) {
    const ReceiverTruth truth = flight(1e-9 * static_cast<double>(ns));
    world.hear(fake.gga(ns / kMs + 43'200'000 - 18'000, truth), ns + kLatency);
    const auto complete = world.receiver.take_fixes(ns + kLatency + 300 * kMs);
    world.fixes.insert(world.fixes.end(), complete.begin(), complete.end());
  };
  // For ten seconds it may be a line that catches up.
  for (int i = 0; i < 130; ++i) say(world.now_ns + i * 100 * kMs);
  EXPECT_EQ(world.receiver.clock().steps(), 1u);
  ASSERT_GT(world.fixes.size(), 20u);
  for (size_t i = 1; i < world.fixes.size(); ++i) EXPECT_LT(world.off(world.fixes[i]), 0.03);
}

// A noisy line: a hundredth of all bytes, each in one bit or to any other byte, for ten minutes.
TEST(NmeaReceiver, AGarbledLineGivesFewWrongPositionsAndNoneFarOff) {
  for (const bool bits : {true, false}) {
    World world(at_origin());
    TestRng noise(bits);
    world.garble = [&](std::string text) {
      for (char& c : text) {
        if (noise.uniform(0, 1) >= 0.01) continue;
        c = static_cast<char>(bits ? c ^ (1 << noise.index(8)) : noise.index(256));
      }
      return text;
    };
    world.run(600);
    size_t wrong = 0;
    double worst = 0, worst_angle = 0;
    for (const PositionFix& fix : world.fixes) {
      const double off = world.off(fix);
      wrong += off > 0.05;
      worst = std::max(worst, off);
      if (!fix.ned_from_body) continue;
      const ReceiverTruth truth = flight(1e-9 * static_cast<double>(fix.time_ns - kLatency));
      worst_angle = std::max(worst_angle, fix.ned_from_body->angularDistance(truth.ned_from_body.rotation));
    }
    // 45 % of sentences of 80 bytes come whole.
    EXPECT_GT(world.fixes.size(), 2000u);
    // What a fix may be off from where the one before leads: 1 m, and 10 m/s^2 times the square of the gap,
    // which is 0.1 s mostly and half a second now and then.
    EXPECT_LT(worst, 3.5);
    // Of two flips one in eight is of the same bit; most of those hit digits that do not matter.
    EXPECT_LT(wrong, world.fixes.size() * (bits ? 8 : 1) / 100);
    EXPECT_LT(worst_angle, 0.35);  // the swing between two attitudes that is let through, and its gap
  }
}

// A fuzzer: any bytes between, among and in place of sentences.
TEST(NmeaReceiver, AnyBytesDoNoHarmAndAllIsWellASecondLater) {
  World world(at_origin());
  TestRng noise;
  const std::string alphabet = "$$$*,\r\n0123456789.+-ABCDEFNSEWTMPRGX";
  for (int round = 0; round < 100; ++round) {
    world.garble = [&](std::string text) {
      for (int i = noise.index(6); i > 0; --i) {
        const auto at = static_cast<size_t>(noise.index(static_cast<int>(text.size())));
        std::string some;
        for (int k = noise.index(30); k > 0; --k) {
          some += noise.uniform(0, 1) < 0.3
                      ? static_cast<char>(noise.index(256))
                      : alphabet[static_cast<size_t>(noise.index(static_cast<int>(alphabet.size())))];
        }
        noise.uniform(0, 1) < 0.5 ? text.insert(at, some)
                                  : text.replace(at, std::min(text.size() - at, some.size()), some);
      }
      return text;
    };
    world.run(0.5);
    world.garble = nullptr;
    world.run(1);
    world.fixes.clear();
    world.run(0.5);
    ASSERT_GE(world.fixes.size(), 4u) << round;
    for (const PositionFix& fix : world.fixes) ASSERT_LT(world.off(fix), 0.025) << round;
  }
}

}  // namespace
}  // namespace perch::nmea
