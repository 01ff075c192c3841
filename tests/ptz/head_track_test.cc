#include "perch/ptz/head_track.h"

#include <gtest/gtest.h>

#include <cmath>

namespace perch {
namespace {

using Verdict = HeadTrack::Verdict;
constexpr double kDeg = 0.017453292519943295;
constexpr int64_t kMs = 1'000'000;

// A head at rest at (10, 5) degrees that has been believed.
HeadTrack resting() {
  HeadTrack track(evi_d30());
  for (int i = 0; i < 4; ++i) track.add(1000 * kMs + i * 40 * kMs, 0.005, 10 * kDeg, 5 * kDeg);
  return track;
}

TEST(HeadTrack, BelievesTheThirdReport) {
  HeadTrack track(evi_d30());
  EXPECT_EQ(track.add(1000 * kMs, 0.005, 0.1, 0), Verdict::kWaits);
  EXPECT_EQ(track.add(1040 * kMs, 0.005, 0.1, 0), Verdict::kWaits);
  EXPECT_FALSE(track.at(1040 * kMs));
  EXPECT_EQ(track.add(1080 * kMs, 0.005, 0.1, 0), Verdict::kUsed);
  EXPECT_NEAR(track.at(1020 * kMs).value().pan, 0.1, 1e-12);
}

TEST(HeadTrack, FollowsTheCommandBetweenAndBeyondReports) {
  HeadTrack track = resting();
  track.moves(1120 * kMs, {HeadGoal::Kind::kDrive, 20 * kDeg, 0});
  EXPECT_NEAR(track.at(1170 * kMs).value().pan, 11 * kDeg, 1e-9);
  EXPECT_EQ(track.add(1220 * kMs, 0.005, 12 * kDeg, 5 * kDeg), Verdict::kUsed);
  EXPECT_NEAR(track.at(1170 * kMs).value().pan, 11 * kDeg, 1e-9);
  EXPECT_NEAR(track.at(1270 * kMs).value().pan, 13 * kDeg, 1e-9);
  // The end stop.
  track.moves(1220 * kMs, {HeadGoal::Kind::kDrive, 0, 500 * kDeg});
  EXPECT_NEAR(track.at(1320 * kMs).value().tilt, 25 * kDeg, 1e-9);
}

TEST(HeadTrack, SaysNothingLongAfterTheLastReport) {
  const HeadTrack track = resting();
  EXPECT_TRUE(track.at(1260 * kMs));
  EXPECT_FALSE(track.at(1280 * kMs));
  EXPECT_FALSE(track.at(900 * kMs));
}

TEST(HeadTrack, AMovingHeadIsLessSure) {
  HeadTrack track = resting();
  const double still = track.at(1140 * kMs).value().pan_sigma;
  track.moves(1120 * kMs, {HeadGoal::Kind::kDrive, 40 * kDeg, 0});
  EXPECT_GT(track.at(1140 * kMs).value().pan_sigma, 2 * still);
  EXPECT_NEAR(still, kDeg / 8.8 / std::sqrt(12), 1e-9);  // rounding alone
}

// A flipped bit: 32 counts are 3.6 degrees.
TEST(HeadTrack, DoubtsAJumpUntilItIsConfirmed) {
  HeadTrack track = resting();
  EXPECT_EQ(track.add(1160 * kMs, 0.005, 13.6 * kDeg, 5 * kDeg), Verdict::kWaits);
  EXPECT_FALSE(track.at(1170 * kMs));  // nobody knows
  EXPECT_TRUE(track.at(1110 * kMs));   // but of before
  EXPECT_EQ(track.add(1200 * kMs, 0.005, 10 * kDeg, 5 * kDeg), Verdict::kUsed);
  EXPECT_NEAR(track.at(1170 * kMs).value().pan, 10 * kDeg, 1e-9);

  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(track.add(1240 * kMs + i * 40 * kMs, 0.005, 50 * kDeg, 5 * kDeg), Verdict::kWaits);
  EXPECT_EQ(track.add(1320 * kMs, 0.005, 50 * kDeg, 5 * kDeg), Verdict::kUsed);
  EXPECT_NEAR(track.at(1330 * kMs).value().pan, 50 * kDeg, 1e-9);
}

// One of the three that were to confirm a jump is garbled, too: by 8 counts.
TEST(HeadTrack, ThreeThatConfirmLieOnOneMotion) {
  HeadTrack track = resting();
  const double angles[] = {50, 50.91, 50, 50, 50};
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(track.add((1160 + 40 * i) * kMs, 0.001, angles[i] * kDeg, 5 * kDeg),
              i < 4 ? Verdict::kWaits : Verdict::kUsed);
  EXPECT_NEAR(track.at(1290 * kMs).value().pan, 50 * kDeg, 1e-9);
}

// Half a degree is within what a change of speed excuses.
TEST(HeadTrack, OnALineThatGarblesThreeReportsTell) {
  HeadTrack track = resting();
  EXPECT_TRUE(track.confirmed_at(1110 * kMs));
  EXPECT_FALSE(track.confirmed_at(1130 * kMs));  // beyond the last report
  track.moves(1121 * kMs, {HeadGoal::Kind::kDrive, 20 * kDeg, 0});
  const auto add = [&](int64_t ms, double pan) { return track.add(ms * kMs, 0.001, pan * kDeg, 5 * kDeg); };
  EXPECT_EQ(add(1160, 10.8 + 0.45), Verdict::kUsed);  // garbled by four counts
  EXPECT_TRUE(track.at(1150 * kMs));
  EXPECT_FALSE(track.confirmed_at(1150 * kMs));
  EXPECT_EQ(add(1200, 11.6), Verdict::kUsed);
  EXPECT_FALSE(track.confirmed_at(1150 * kMs));
  EXPECT_FALSE(track.confirmed_at(1190 * kMs));  // the three are on no line
  EXPECT_EQ(add(1240, 12.4), Verdict::kUsed);
  EXPECT_EQ(add(1280, 13.2), Verdict::kUsed);
  EXPECT_NEAR(track.confirmed_at(1250 * kMs).value().pan, 12.6 * kDeg, 1e-9);
  EXPECT_FALSE(track.confirmed_at(1150 * kMs));
}

// A drive that became another on its way: 13.3 degrees/s in place of 20. Garbled reports may do that, too.
TEST(HeadTrack, OnALineThatGarblesAnotherMotionNeedsFive) {
  HeadTrack track = resting();
  track.moves(1121 * kMs, {HeadGoal::Kind::kDrive, 20 * kDeg, 0});
  for (int i = 0; i < 5; ++i) {
    EXPECT_FALSE(track.confirmed_at(1190 * kMs)) << i;
    track.add((1160 + 40 * i) * kMs, 0.001, (10.52 + 0.533 * i) * kDeg, 5 * kDeg);
  }
  EXPECT_NEAR(track.confirmed_at(1300 * kMs).value().pan, (10.52 + 0.533 * 3.5) * kDeg, 1e-3);
}

TEST(HeadTrack, OnALineThatGarblesACommandNobodyAcknowledgedMayWork) {
  HeadTrack track = resting();
  track.may_move(1125 * kMs, 1150 * kMs);
  EXPECT_EQ(track.add(1160 * kMs, 0.001, 10 * kDeg, 5 * kDeg), Verdict::kUsed);
  EXPECT_TRUE(track.at(1140 * kMs));
  EXPECT_FALSE(track.confirmed_at(1140 * kMs));
  EXPECT_TRUE(track.confirmed_at(1110 * kMs));
}

TEST(HeadTrack, RefusesWhatNoHeadSays) {
  HeadTrack track = resting();
  EXPECT_EQ(track.add(1160 * kMs, 0.005, 101 * kDeg, 0), Verdict::kRefused);
  EXPECT_EQ(track.add(1160 * kMs, 0.005, 0, -26 * kDeg), Verdict::kRefused);
  EXPECT_EQ(track.add(1160 * kMs, 0.005, NAN, 0), Verdict::kRefused);
  EXPECT_EQ(track.add(1100 * kMs, 0.005, 10 * kDeg, 5 * kDeg), Verdict::kRefused);  // the clock went back
}

}  // namespace
}  // namespace perch
