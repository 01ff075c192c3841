#include "perch/analysis/score.h"

#include "analysis/flights.h"
#include "support/near_pose.h"

namespace perch {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;
using testing::SizeIs;

TEST(Score, ConstantOffsetsComeOutAsDc) {
  TestRng rng;
  MadeUpFlight made;
  made.offset << 0.03, -0.02, 0.05, 0.01, -0.02, 0.015;
  const FlightScore score = score_flight(make_flight(made, rng));
  ASSERT_EQ(score.comparison, Comparison::kCompared);
  for (size_t i = 0; i < 6; ++i) {
    const double offset = made.offset[static_cast<Eigen::Index>(i)];
    // Rounding of numbers of up to 10 m, and of an arc sine near its middle.
    EXPECT_NEAR(score.states[i].mean, offset, 64 * kEpsilon * 10) << kStateNames[i];
    EXPECT_NEAR(score.states[i].rms, std::abs(offset), 64 * kEpsilon * 10) << kStateNames[i];
    EXPECT_LE(score.states[i].rms_without_mean, 64 * kEpsilon * 10) << kStateNames[i];
  }
}

TEST(Score, YawAcrossPiIsNoErrorOfATurn) {
  TestRng rng;
  MadeUpFlight made;
  made.yaw = M_PI - 0.1;  // the descent's yaw swings by 0.2, so it passes pi
  made.offset << 0, 0, 0, 0.02, 0, 0;
  const FlightScore score = score_flight(make_flight(made, rng));
  EXPECT_NEAR(score.states[3].mean, 0.02, 64 * kEpsilon * 10);
  EXPECT_NEAR(score.states[3].max, 0.02, 64 * kEpsilon * 10);
}

TEST(Score, DifferenceIsVisionMinusNavigationInPadAxes) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 1}, rng);
  // A pad that lies turned and away from the world's origin: the error is still seen in its axes.
  const Rigid3 world_from_pad{rng.rotation(), {10, 20, 30}};
  result.chain.world_from_pad = world_from_pad;
  result.flight.nav.samples[0].world_from_body = world_from_pad * result.estimates[0].pad_from_body->mean;
  result.estimates[0].pad_from_body->mean.translation += Eigen::Vector3d(0.1, 0, 0);
  const FlightScore score = score_flight(result);
  ASSERT_TRUE(score.frames[0].error);
  EXPECT_NEAR(score.frames[0].error->difference[0], 0.1, 64 * kEpsilon * 40);
  EXPECT_NEAR(score.frames[0].error->difference[1], 0, 64 * kEpsilon * 40);
  EXPECT_NEAR(score.frames[0].error->position, 0.1, 64 * kEpsilon * 40);
}

// A receiver with one antenna.
TEST(Score, NavigationWithoutAnAttitudeIsComparedInPosition) {
  TestRng rng;
  MadeUpFlight made;
  made.offset << 0.03, -0.02, 0.05, 0.01, -0.02, 0.015;
  FlightResult result = make_flight(made, rng);
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  for (NavSample& sample : result.flight.nav.samples)
    sample.world_from_body.rotation = Eigen::Quaterniond(unknown, unknown, unknown, unknown);
  const FlightScore score = score_flight(result);
  ASSERT_EQ(score.comparison, Comparison::kCompared);
  EXPECT_EQ(score.position.count, 100u);
  for (size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(score.states[i].mean, made.offset[static_cast<Eigen::Index>(i)], 1e-12);
  for (size_t i = 3; i < 6; ++i) EXPECT_EQ(score.states[i].count, 0u);
  EXPECT_EQ(score.rotation.count, 0u);
  EXPECT_EQ(score.consistency.nees.count, 0u);
  EXPECT_EQ(score.attribution.count, 0u);
  ASSERT_FALSE(score.curves.empty());
  for (const ErrorCurve& curve : score.curves) {
    for (const ErrorBin& bin : curve.bins) EXPECT_EQ(std::isfinite(bin.position_rms), bin.count > 0);
  }
}

TEST(Score, NavigationIsAskedAtItsOwnTime) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 50}, rng);
  result.chain.time_offset = 0.5;  // the camera's clock is ahead
  for (NavSample& sample : result.flight.nav.samples) sample.timestamp_ns -= 500'000'000;
  const FlightScore score = score_flight(result);
  EXPECT_EQ(score.position.count, 50u);
  EXPECT_LE(score.position.max, 64 * kEpsilon * 10);
}

TEST(Score, NeesOfHonestNoiseIsWithinItsBounds) {
  TestRng rng;
  const FlightScore score = score_flight(make_flight({.frames = 2000, .noise = 0.05}, rng));
  EXPECT_EQ(score.consistency.nees.count, 2000u);
  // The bounds of 95 %, doubled in width: four sigma of the mean.
  const double half = score.consistency.nees.upper - 6;
  EXPECT_NEAR(half, 2 * std::sqrt(12.0 / 2000), 0.01);  // chi-square's variance 2 k, k = 6
  EXPECT_NEAR(score.consistency.nees.mean, 6, 2 * half);
  EXPECT_NEAR(score.consistency.nees.fraction_inside, 0.95, 4 * std::sqrt(0.95 * 0.05 / 2000));
}

TEST(Score, NeesOfABoastIsAbove) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 200, .noise = 0.05}, rng);
  for (Estimate& estimate : result.estimates) estimate.camera_from_target.covariance /= 4;
  const FlightScore score = score_flight(result);
  EXPECT_GT(score.consistency.nees.mean, 3 * score.consistency.nees.upper);
}

TEST(Score, NavigationsNoiseIsNotVisionsWhereThereIsTruth) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 500, .noise = 0.01}, rng);
  result.flight.truth = result.flight.nav;
  for (NavSample& sample : result.flight.nav.samples) sample.world_from_body.translation += rng.normal3(0.05);
  const FlightScore score = score_flight(result);
  ASSERT_TRUE(score.truth);
  EXPECT_TRUE(score.consistency.by_truth);
  EXPECT_EQ(score.truth->position.count, 500u);
  // Three axes of 1 cm; an RMS of N samples of 3 components scatters by 1 / sqrt(6 N), here 1.8 %: four of
  // them.
  EXPECT_NEAR(score.truth->position.rms, 0.01 * std::sqrt(3), 0.073 * 0.01 * std::sqrt(3));
  EXPECT_GT(score.position.rms, 0.08);
  EXPECT_NEAR(score.consistency.nees.mean, 6, 2 * (score.consistency.nees.upper - 6));

  // Without it navigation's noise is in the number, and the score says so.
  result.flight.truth.samples.clear();
  const FlightScore by_navigation = score_flight(result);
  EXPECT_FALSE(by_navigation.truth);
  EXPECT_FALSE(by_navigation.consistency.by_truth);
  EXPECT_GT(by_navigation.consistency.nees.mean, 10 * 6);
}

TEST(Score, TruthIsOnTheCamerasClock) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 50}, rng);
  result.flight.truth = result.flight.nav;
  result.chain.time_offset = 0.1;  // navigation's clock is another, and here it is not
  for (NavSample& sample : result.flight.nav.samples) sample.timestamp_ns -= 100'000'000;
  const FlightScore score = score_flight(result);
  ASSERT_TRUE(score.truth);
  EXPECT_LE(score.truth->position.max, 64 * kEpsilon * 10);
  EXPECT_LE(score.position.max, 64 * kEpsilon * 10);
}

// Far away a tilt's error is an arc in the pad frame; the camera's frame, with a target that lies turned on
// the pad, knows no such.
TEST(Score, NeesOfHonestTiltFarAwayIsWithinItsBounds) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 2000}, rng);
  result.chain.target_from_pad = {rotation_from_ypr({0.7, 0, 0}), {0.3, -0.2, 0}};
  const Rigid3& target_from_pad = result.chain.target_from_pad;
  PoseError sigmas;
  sigmas << 0.01, 0.01, 0.02, 0.1, 0.1, 0.01;  // m, rad
  for (size_t i = 0; i < result.estimates.size(); ++i) {
    const Rigid3 truth = result.flight.nav.samples[i].world_from_body;  // world is pad, camera is body
    PoseError error;
    for (int k = 0; k < 6; ++k) error[k] = rng.normal(sigmas[k]);
    UncertainRigid3& seen = result.estimates[i].camera_from_target;
    seen.mean = perturb(inverse(truth) * inverse(target_from_pad), error);
    seen.covariance = sigmas.cwiseAbs2().asDiagonal();
    result.estimates[i].pad_from_body = pad_from_body_by_vision(result.chain, seen);
  }
  const FlightScore score = score_flight(result);
  // The bounds of 95 %, doubled in width: four sigma of the mean.
  EXPECT_NEAR(score.consistency.nees.mean, 6, 2 * (score.consistency.nees.upper - 6));
  // sqrt(1 + 1 + 4) cm at 1 to 9 m; the body's own is a tilt of 0.14 rad, some 14 % of the range.
  EXPECT_GT(score.consistency.seen_over_range_rms, 0.0245 / 9);
  EXPECT_LT(score.consistency.seen_over_range_rms, 0.0245 / 1);
  EXPECT_GT(score.relative_position_rms, 0.1);
}

TEST(Score, SigmasOfTheAnglesAreThoseOfSamples) {
  TestRng rng;
  UncertainRigid3 pose{{rotation_from_ypr({0.4, 0.7, -2}), {1, 2, 3}}, PoseCovariance::Zero()};
  pose.covariance.diagonal() << 0.01, 0.04, 0.09, 1e-4, 4e-4, 9e-4;
  const SixStates sigmas = six_sigmas(pose);
  constexpr int kSamples = 4000;
  SixStates squares = SixStates::Zero();
  for (int i = 0; i < kSamples; ++i) {
    PoseError error;
    for (int k = 0; k < 6; ++k) error[k] = rng.normal(std::sqrt(pose.covariance(k, k)));
    SixStates difference = six_states(perturb(pose.mean, error)) - six_states(pose.mean);
    for (int k = 3; k < 6; ++k) difference[k] = wrap_angle(difference[k]);
    squares += difference.cwiseAbs2();
  }
  for (int k = 0; k < 6; ++k) {
    // A deviation from N samples scatters by 1 / sqrt(2 N), here 1.1 %; four of them, and 1 % for the
    // curvature.
    EXPECT_NEAR(sigmas[k] / std::sqrt(squares[k] / kSamples), 1, 0.055) << k;
  }
}

TEST(Score, CovarianceThatIsNoneGivesNoNees) {
  TestRng rng;
  const FlightScore score = score_flight(make_flight({.frames = 10, .noise = 0}, rng));  // all zero
  EXPECT_EQ(score.consistency.nees.count, 0u);
  EXPECT_EQ(score.position.count, 10u);
}

TEST(Score, BinsHoldEveryComparedFrameOnce) {
  TestRng rng;
  const FlightScore score = score_flight(make_flight({.frames = 300, .noise = 0.02}, rng));
  ASSERT_FALSE(score.curves[0].bins.empty());
  EXPECT_LE(score.curves[0].bins.size(), 10u);
  EXPECT_GE(score.curves[0].bins.size(), 5u);
  size_t frames = 0;
  for (const ErrorBin& bin : score.curves[0].bins) {
    frames += bin.count;
    size_t expected = 0;
    for (const FrameRecord& frame : score.frames) expected += bin.from <= frame.range && frame.range < bin.to;
    EXPECT_EQ(bin.count, expected);
  }
  EXPECT_EQ(frames, 300u);
}

TEST(Score, HoveringFillsOneBin) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 20}, rng);
  for (Estimate& estimate : result.estimates) estimate.camera_from_target.mean.translation = {0, 0, 2.005};
  EXPECT_THAT(score_flight(result).curves[0].bins, ElementsAre(Field(&ErrorBin::count, 20u)));
}

TEST(Score, RelativeErrorIsOverTheRange) {
  TestRng rng;
  MadeUpFlight made{.frames = 2};
  made.offset << 0.3, 0, 0, 0, 0, 0;
  FlightResult result = make_flight(made, rng);
  result.estimates[0].camera_from_target.mean.translation = {0, 0, 3};
  result.estimates[1].camera_from_target.mean.translation = {0, 0, 1};
  // sqrt((0.1^2 + 0.3^2) / 2)
  EXPECT_NEAR(score_flight(result).relative_position_rms, std::sqrt(0.05), 1e-14);
}

TEST(Score, GapsKnowTheirPlaceLengthAndReasons) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 10}, rng);
  lose(result, 0, EstimateStatus::kNoTarget);
  lose(result, 4, EstimateStatus::kPartial);
  lose(result, 5, EstimateStatus::kUnreadable);
  lose(result, 9, EstimateStatus::kAmbiguous);
  const Detections detections = score_flight(result).detections;
  EXPECT_DOUBLE_EQ(detections.rate, 0.6);
  EXPECT_THAT(detections.counts, ElementsAre(6, 1, 1, 1, 0, 1));
  ASSERT_THAT(detections.gaps, SizeIs(3));
  EXPECT_EQ(detections.gaps[0].first_frame, 0u);
  EXPECT_NEAR(detections.gaps[0].duration, 1e-9 * kFrameNs, 1e-12);
  EXPECT_EQ(detections.gaps[1].first_frame, 4u);
  EXPECT_EQ(detections.gaps[1].frames, 2u);
  EXPECT_NEAR(detections.gaps[1].start, 4e-9 * kFrameNs, 1e-12);
  EXPECT_NEAR(detections.gaps[1].duration, 2e-9 * kFrameNs, 1e-12);
  EXPECT_THAT(detections.gaps[1].reasons, ElementsAre(0, 0, 1, 0, 0, 1));
  EXPECT_EQ(detections.gaps[2].duration, 0);  // nothing follows
}

TEST(Score, StagesShareTheTotalTime) {
  TestRng rng;
  const StageCosts costs = score_flight(make_flight({.frames = 4}, rng)).costs;
  ASSERT_THAT(costs.stages, SizeIs(4));
  EXPECT_EQ(costs.stages[0].stage, "threshold");
  EXPECT_DOUBLE_EQ(costs.stages[0].us.mean, 10);
  EXPECT_DOUBLE_EQ(costs.stages[0].share, 10.0 / 80);
  EXPECT_EQ(costs.stages[3].stage, "other");
  EXPECT_DOUBLE_EQ(costs.stages[3].share, 20.0 / 80);
  EXPECT_DOUBLE_EQ(costs.total_us.mean, 80);
}

TEST(Score, AStageThatRanOnceCostsLittleOfTheWhole) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 4}, rng);
  result.estimates[2].stages.push_back({"second try", 16});
  const StageCosts costs = score_flight(result).costs;
  EXPECT_EQ(costs.stages[3].us.count, 1u);
  EXPECT_DOUBLE_EQ(costs.stages[3].us.mean, 16);
  EXPECT_DOUBLE_EQ(costs.stages[3].share, 16.0 / (4 * 80));
}

TEST(Score, SaysWhyNothingIsCompared) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 5}, rng);
  FlightResult no_pad = result, no_nav = result, undetected = result;
  no_pad.chain.world_from_pad.reset();
  no_nav.flight.nav.samples.clear();
  for (size_t i = 0; i < 5; ++i) lose(undetected, i, EstimateStatus::kNoTarget);
  EXPECT_EQ(score_flight(no_pad).comparison, Comparison::kNoWorldFromPad);
  EXPECT_EQ(score_flight(no_nav).comparison, Comparison::kNoNavigation);
  EXPECT_EQ(score_flight(undetected).comparison, Comparison::kNoCommonTime);
  EXPECT_THAT(score_flight(no_nav).curves[0].bins, IsEmpty());
  EXPECT_TRUE(score_flight(no_nav).frames[0].vision);
  EXPECT_EQ(score_flight(no_nav).reprojection_px.count, 5u);
}

TEST(Score, NavigationIsKnownInGaps) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 3}, rng);
  lose(result, 1, EstimateStatus::kNoTarget);
  const FlightScore score = score_flight(result);
  EXPECT_TRUE(score.frames[1].navigation);
  EXPECT_FALSE(score.frames[1].error);
}

TEST(Score, APoseThatIsNoNumberCountsInNoStatistic) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 3}, rng);
  result.estimates[1].pad_from_body->mean.translation.x() = std::nan("");
  const FlightScore score = score_flight(result);
  EXPECT_EQ(score.position.count, 2u);
  EXPECT_TRUE(std::isfinite(score.position.rms));
}

TEST(Score, OfNoFramesIsOfNothing) {
  const FlightScore score = score_flight({});
  EXPECT_EQ(score.detections.rate, 0);
  EXPECT_THAT(score.detections.gaps, IsEmpty());
  EXPECT_THAT(score.states, Each(Field(&Statistics::count, 0u)));
  EXPECT_THAT(frames_to_show(score), IsEmpty());
}

TEST(FramesToShow, AreTheBestMedianWorstAndAGap) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 9}, rng);
  for (size_t i = 0; i < 9; ++i) {
    result.estimates[i].pad_from_body->mean.translation.x() += 0.01 * static_cast<double>((i + 4) % 9);
  }
  lose(result, 7, EstimateStatus::kUnreadable);
  lose(result, 8, EstimateStatus::kNoTarget);
  const FlightScore score = score_flight(result);  // errors of frames 0..6: 4 5 6 7 8 0 1 cm
  EXPECT_THAT(frames_to_show(score),
              ElementsAre(Field(&ShownFrame::frame, 5u), Field(&ShownFrame::frame, 1u),
                          Field(&ShownFrame::frame, 4u), Field(&ShownFrame::frame, 8u)));
}

TEST(FramesToShow, GoByReprojectionWithoutNavigation) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 3}, rng);
  result.flight.nav.samples.clear();
  result.estimates[0].reprojection_rms_px = 0.5;
  result.estimates[2].reprojection_rms_px = 0.1;
  EXPECT_THAT(frames_to_show(score_flight(result)),
              ElementsAre(Field(&ShownFrame::frame, 2u), Field(&ShownFrame::frame, 1u),
                          Field(&ShownFrame::frame, 0u)));
}

TEST(FramesToShow, ShowASingleFrameOnce) {
  TestRng rng;
  EXPECT_THAT(frames_to_show(score_flight(make_flight({.frames = 1}, rng))), SizeIs(1));
}

}  // namespace
}  // namespace perch
