#include "perch/tracking/filter.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "perch/geometry/so3.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

constexpr int64_t kSecond = 1'000'000'000;
constexpr int64_t kFrame = kSecond / 30;
constexpr double kSigma = 0.01;  // of the measurements, m and rad

UncertainRigid3 measured(const Rigid3& pad_from_body, double sigma = kSigma) {
  return {pad_from_body, sigma * sigma * PoseCovariance::Identity()};
}

// A body that moves and turns evenly; the turn is about an axis of the pad.
struct Motion {
  Rigid3 start{Eigen::Quaterniond(Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 2, -1).normalized())),
               {1, -2, 5}};
  Eigen::Vector3d velocity{0.5, -0.3, -1};
  Eigen::Vector3d angular_velocity{0, 0, 0};

  Rigid3 at(int64_t t) const {
    const double s = static_cast<double>(t) * 1e-9;
    return {so3_exp(angular_velocity * s) * start.rotation, start.translation + velocity * s};
  }
};

// A filter on a simulated clock that has followed a motion for a while.
class FilterTest : public testing::Test {
 protected:
  std::optional<VehicleState> see(const Rigid3& pad_from_body) {
    now_ += kFrame;
    return filter_.update(now_, measured(pad_from_body));
  }
  std::optional<VehicleState> see_nothing() {
    now_ += kFrame;
    return filter_.update(now_, std::nullopt);
  }
  // Two seconds: settled. A disturbance decays with the time constant (sigma^2 dt / q^2)^(1/4) = 0.04 s.
  void follow(const Motion& motion, int64_t duration = 2 * kSecond) {
    for (const int64_t end = now_ + duration; now_ < end;) see(motion.at(now_ + kFrame));
  }

  TrackingOptions options_;
  VehicleFilter filter_{options_};
  Motion motion_;
  int64_t now_ = 0;
};

using Filter = FilterTest;

TEST_F(Filter, SaysNothingBeforeTheFirstMeasurement) {
  EXPECT_FALSE(filter_.predict(0));
  EXPECT_FALSE(filter_.update(0, std::nullopt));
  EXPECT_FALSE(filter_.update(kSecond, std::nullopt));
}

TEST_F(Filter, StartsAtTheFirstMeasurementWithWhatIsKnownOfTheMotion) {
  const UncertainRigid3 first = measured(motion_.start);
  const auto state = filter_.update(7 * kSecond, first);
  ASSERT_TRUE(state);
  EXPECT_EQ(state->timestamp_ns, 7 * kSecond);
  EXPECT_EQ(state->source, StateSource::kVision);
  EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.start, 0.0, 0.0));
  EXPECT_THAT(state->body_velocity_in_pad, IsNearMatrix(Eigen::Vector3d::Zero(), 0.0));
  Eigen::Matrix<double, 12, 1> variances;
  variances << first.covariance.diagonal(),
      Eigen::Vector3d::Constant(std::pow(options_.initial_velocity_sigma, 2)),
      Eigen::Vector3d::Constant(std::pow(options_.initial_angular_velocity_sigma, 2));
  const Eigen::Matrix<double, 12, 12> expected = variances.asDiagonal();
  EXPECT_THAT(state->covariance, IsNearMatrix(expected, 0.0));
}

TEST_F(Filter, VelocityConvergesToThatOfAnEvenMotion) {
  motion_.angular_velocity = {0.3, -0.2, 0.5};
  // WHEN it has seen two seconds of exact measurements
  follow(motion_);
  const auto state = filter_.predict(now_);
  // THEN the start is forgotten by e^-40 and more; a margin of 1e6 over the rounding of 10 m in 33 ms.
  EXPECT_THAT(state->body_velocity_in_pad, IsNearMatrix(motion_.velocity, 1e-7));
  EXPECT_THAT(state->body_angular_velocity_in_pad, IsNearMatrix(motion_.angular_velocity, 1e-7));
  EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.at(now_), 1e-8, 1e-8));
}

TEST_F(Filter, PredictsAlongTheMotionWithoutChangingAnything) {
  motion_.angular_velocity = {0.3, -0.2, 0.5};
  follow(motion_);
  const auto before = filter_.predict(now_);
  const auto ahead = filter_.predict(now_ + kSecond / 2);
  EXPECT_EQ(ahead->source, StateSource::kPredicted);
  EXPECT_EQ(ahead->timestamp_ns, now_ + kSecond / 2);
  // Half a second of what the velocity may be off.
  EXPECT_THAT(ahead->pad_from_body, IsNearPose(motion_.at(now_ + kSecond / 2), 1e-7, 1e-7));
  EXPECT_GT(ahead->covariance(0, 0), before->covariance(0, 0));
  const auto after = filter_.predict(now_);
  EXPECT_THAT(after->pad_from_body, IsNearPose(before->pad_from_body, 0.0, 0.0));
  EXPECT_THAT(after->covariance, IsNearMatrix(before->covariance, 0.0));
}

TEST_F(Filter, TellsHowMuchAPoseSurprisesIt) {
  EXPECT_FALSE(see(motion_.start)->innovation_squared);  // nothing was expected
  follow(motion_);
  for (const double off : {0.02, 1.0}) {  // believed, and not
    const int64_t next = now_ + kFrame;
    const VehicleState expected = *filter_.predict(next);
    const UncertainRigid3 seen =
        measured(perturb(motion_.at(next), (PoseError() << off, 0, 0, 0, off / 10, 0).finished()));
    const auto state = filter_.update(now_ = next, seen);
    ASSERT_TRUE(state->innovation_squared) << off;
    const PoseCovariance covariance = expected.covariance.topLeftCorner<6, 6>() + seen.covariance;
    const double squared =
        normalised_error_squared(pose_error(expected.pad_from_body, seen.mean), covariance);
    EXPECT_NEAR(*state->innovation_squared / squared, 1, 1e-9) << off;
    EXPECT_EQ(state->source, off < 0.1 ? StateSource::kVision : StateSource::kPredicted);
  }
  EXPECT_FALSE(see_nothing()->innovation_squared);
}

// A body hanging upside down (a camera that looks down) that yaws to the left as seen from above the pad, z
// up: its own z axis points down, so in its own axes the rate would be the opposite.
TEST_F(Filter, AngularVelocityIsInTheAxesOfThePad) {
  motion_.start.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
  motion_.angular_velocity = {0, 0, 0.5};
  follow(motion_);
  // By hand: the body's x axis was the pad's and has turned towards the pad's y.
  const double s = static_cast<double>(now_) * 1e-9;
  const auto state = filter_.predict(now_);
  EXPECT_THAT(state->pad_from_body.rotation * Eigen::Vector3d::UnitX(),
              IsNearMatrix(Eigen::Vector3d(std::cos(0.5 * s), std::sin(0.5 * s), 0), 1e-8));
  EXPECT_THAT(state->body_angular_velocity_in_pad, IsNearMatrix(Eigen::Vector3d(0, 0, 0.5), 1e-7));
}

TEST_F(Filter, FollowsARotationThroughPi) {
  // Rotation vectors jump from pi to -pi on the way, and the quaternion's sign with them.
  motion_.start.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(M_PI - 0.5, Eigen::Vector3d::UnitX()));
  motion_.angular_velocity = {0.5, 0, 0};
  for (int i = 0; i < 90; ++i) {
    Rigid3 seen = motion_.at(now_ + kFrame);
    seen.rotation = positive_w(seen.rotation);
    const auto state = see(seen);
    EXPECT_EQ(state->source, StateSource::kVision) << i;
    // On its way from no velocity to 0.5 rad/s it is late by a part of one frame's turn, 17 mrad.
    EXPECT_LE(state->pad_from_body.rotation.angularDistance(seen.rotation), 0.017) << i;
  }
  EXPECT_THAT(filter_.predict(now_)->body_angular_velocity_in_pad,
              IsNearMatrix(motion_.angular_velocity, 1e-7));
}

TEST_F(Filter, RefusesAnOutlier) {
  follow(motion_);
  Rigid3 wrong = motion_.at(now_ + kFrame);
  wrong.translation.x() += 1;  // a hundred sigma
  const auto state = see(wrong);
  EXPECT_EQ(state->source, StateSource::kPredicted);
  EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.at(now_), 1e-8, 1e-8));
  // AND the next honest one is believed.
  EXPECT_EQ(see(motion_.at(now_ + kFrame))->source, StateSource::kVision);
}

TEST_F(Filter, BelievesWhatIsWithinTheGateAndNothingBeyond) {
  follow(motion_);
  // What a lively body may do is believed, however calm this one was.
  const auto predicted = filter_.predict_widely(now_ + kFrame);
  const double sigma = std::sqrt(predicted->covariance(0, 0) + kSigma * kSigma);
  const double gate = std::sqrt(options_.gate) * sigma;
  for (const double part : {0.99, 1.01}) {
    VehicleFilter filter = filter_;
    Rigid3 seen = motion_.at(now_ + kFrame);
    seen.translation.x() += part * gate;
    const auto state = filter.update(now_ + kFrame, measured(seen));
    EXPECT_EQ(state->source, part < 1 ? StateSource::kVision : StateSource::kPredicted) << part;
  }
}

TEST_F(Filter, StartsAnewWhenItRefusedSeveralInARow) {
  follow(motion_);
  motion_.start.translation.x() += 5;  // it is the filter that is wrong
  for (int i = 1; i < options_.restart_after; ++i) {
    EXPECT_EQ(see(motion_.at(now_ + kFrame))->source, StateSource::kPredicted) << i;
  }
  const auto state = see(motion_.at(now_ + kFrame));
  EXPECT_EQ(state->source, StateSource::kVision);
  EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.at(now_), 0.0, 0.0));
  EXPECT_EQ(state->covariance(6, 6), std::pow(options_.initial_velocity_sigma, 2));
}

TEST_F(Filter, RefusalsThatAreNotInARowDoNotAddUp) {
  follow(motion_);
  for (int i = 0; i < 4 * options_.restart_after; ++i) {
    Rigid3 seen = motion_.at(now_ + kFrame);
    const bool honest = i % options_.restart_after == 0;
    if (!honest) seen.translation.x() += 5;
    EXPECT_EQ(see(seen)->source, honest ? StateSource::kVision : StateSource::kPredicted) << i;
  }
}

TEST_F(Filter, CoastsWithoutMeasurementsAndIsLostThen) {
  follow(motion_);
  const int64_t last = now_;
  while (now_ + kFrame <= last + kSecond) {
    const auto state = see_nothing();
    ASSERT_EQ(state->source, StateSource::kPredicted) << now_ - last;
    // A second of what the velocity may be off.
    EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.at(now_), 1e-6, 1e-6));
  }
  EXPECT_EQ(see_nothing()->source, StateSource::kLost);
  EXPECT_FALSE(filter_.predict(now_));
  const auto lost = see_nothing();
  EXPECT_EQ(lost->source, StateSource::kLost);
  EXPECT_EQ(lost->timestamp_ns, now_);
}

TEST_F(Filter, RecoversFromBeingLostAtTheNextMeasurement) {
  follow(motion_);
  for (int i = 0; i < 60; ++i) see_nothing();
  motion_.start.translation.y() += 20;  // flown elsewhere meanwhile
  const auto state = see(motion_.at(now_ + kFrame));
  EXPECT_EQ(state->source, StateSource::kVision);
  EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.at(now_), 0.0, 0.0));
  follow(motion_);
  EXPECT_THAT(filter_.predict(now_)->body_velocity_in_pad, IsNearMatrix(motion_.velocity, 1e-7));
}

TEST_F(Filter, StartsAnewWhenTheClockGoesBack) {
  follow(motion_);
  EXPECT_FALSE(filter_.predict(now_ - kSecond));
  const auto state = filter_.update(now_ - kSecond, measured(motion_.start));
  EXPECT_EQ(state->timestamp_ns, now_ - kSecond);
  EXPECT_EQ(state->source, StateSource::kVision);
  EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.start, 0.0, 0.0));
  EXPECT_THAT(state->body_velocity_in_pad, IsNearMatrix(Eigen::Vector3d::Zero(), 0.0));
}

TEST_F(Filter, IsLostWhenTheClockGoesBackWithoutAMeasurement) {
  follow(motion_);
  EXPECT_EQ(filter_.update(now_ - kSecond, std::nullopt)->source, StateSource::kLost);
  EXPECT_EQ(filter_.update(now_, std::nullopt)->source, StateSource::kLost);
}

TEST_F(Filter, CountsAFrameThatComesTwiceOnce) {
  follow(motion_);
  const auto once = filter_.update(now_ + kFrame, measured(motion_.at(now_ + kFrame)));
  for (int i = 0; i < 3; ++i) {
    Rigid3 again = motion_.at(now_ + kFrame);
    again.translation.x() += kSigma;
    const auto twice = filter_.update(now_ + kFrame, measured(again));
    EXPECT_EQ(twice->source, StateSource::kVision);
    EXPECT_THAT(twice->pad_from_body, IsNearPose(once->pad_from_body, 0.0, 0.0));
    EXPECT_THAT(twice->covariance, IsNearMatrix(once->covariance, 0.0));
  }
}

TEST_F(Filter, TakesAMeasurementOfATimeThatWasOnlyPredicted) {
  follow(motion_);
  see_nothing();
  const auto predicted = filter_.predict(now_);
  const auto state = filter_.update(now_, measured(motion_.at(now_)));
  EXPECT_EQ(state->source, StateSource::kVision);
  EXPECT_LT(state->covariance(0, 0), predicted->covariance(0, 0));
}

TEST_F(Filter, StartsAnewAfterAGapHoweverLong) {
  for (const int64_t then : {now_ + 2 * kSecond, int64_t{1} << 62, std::numeric_limits<int64_t>::max()}) {
    VehicleFilter filter(options_);
    // The earliest time there is: the difference to the last does not fit into an int64_t.
    filter.update(std::numeric_limits<int64_t>::min(), measured(motion_.start));
    EXPECT_FALSE(filter.predict(then));
    Rigid3 elsewhere = motion_.start;
    elsewhere.translation.x() += 100;
    const auto state = filter.update(then, measured(elsewhere));
    EXPECT_EQ(state->source, StateSource::kVision);
    EXPECT_THAT(state->pad_from_body, IsNearPose(elsewhere, 0.0, 0.0));
  }
}

TEST_F(Filter, TakesAMeasurementThatIsNoneForNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<UncertainRigid3> none(5, measured(motion_.start));
  none[0].mean.translation.y() = nan;
  none[1].mean.rotation.z() = nan;
  none[2].covariance(2, 3) = none[2].covariance(3, 2) = nan;
  none[3].covariance(4, 4) = -1;
  none[4].covariance(1, 1) = std::numeric_limits<double>::infinity();
  for (const auto& bad : none) EXPECT_FALSE(filter_.update(++now_, bad));
  follow(motion_);
  for (const auto& bad : none) {
    now_ += kFrame;
    const auto state = filter_.update(now_, bad);
    EXPECT_EQ(state->source, StateSource::kPredicted);
    EXPECT_THAT(state->pad_from_body, IsNearPose(motion_.at(now_), 1e-7, 1e-7));
  }
  EXPECT_EQ(see(motion_.at(now_ + kFrame))->source, StateSource::kVision);
}

TEST_F(Filter, CovarianceIsSymmetricAndPositiveAfterTenThousandSteps) {
  TestRng rng;
  motion_.angular_velocity = {1, -2, 3};
  for (int i = 0; i < 10'000; ++i) {
    // Steps of 0 to 100 ms, sigmas from micrometres to metres, every third frame without the target.
    now_ += rng.index(100) * 1'000'000;
    const double sigma = std::pow(10, rng.uniform(-6, 0));
    const auto state = rng.index(3) == 0 ? filter_.update(now_, std::nullopt)
                                         : filter_.update(now_, measured(motion_.at(now_), sigma));
    if (!state) continue;
    const auto& P = state->covariance;
    ASSERT_THAT(P, IsNearMatrix(P.transpose(), 0.0)) << i;
    // Whatever the units: of the correlations.
    const Eigen::Matrix<double, 12, 1> scale = P.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::Matrix<double, 12, 12> correlation = scale.asDiagonal() * P * scale.asDiagonal();
    const Eigen::LLT<Eigen::Matrix<double, 12, 12>> llt(correlation);
    ASSERT_EQ(llt.info(), Eigen::Success) << i;
  }
}

TEST_F(Filter, ExpectsMoreOfALivelyBodyThanOfTheCalmOneItSees) {
  follow(motion_);
  const auto calm = filter_.predict(now_ + kFrame), lively = filter_.predict_widely(now_ + kFrame);
  // The velocity's variance goes with the noise's density to the power of 3/2: of 0.4 of it, 0.25; of 0.15,
  // 0.06.
  EXPECT_LT(calm->covariance(6, 6), 0.3 * lively->covariance(6, 6));
  // A wrong velocity at the start takes the calm one longer, but nothing is left of it.
  EXPECT_THAT(calm->pad_from_body, IsNearPose(lively->pad_from_body, 1e-6, 1e-6));
}

TEST_F(Filter, BelievesALivelyBodyAtOnce) {
  follow(motion_);
  // WHEN the body, calm until now, brakes with 3 m/s^2 in every axis
  const Motion before = motion_;
  Rigid3 seen;
  for (int i = 1; i <= 15; ++i) {
    seen = before.at(now_ + kFrame);
    const double s = i / 30.0;
    seen.translation -= Eigen::Vector3d::Constant(3 * s * s / 2);
    const auto state = see(seen);
    EXPECT_EQ(state->source, StateSource::kVision) << i;
    // Late by some (sigma^2 dt / q^2)^(1/4) = 0.04 s of the acceleration, and half a second of which it was
    // sure that there is none.
    EXPECT_LE((state->body_velocity_in_pad - (before.velocity - Eigen::Vector3d::Constant(3 * s))).norm(),
              0.8);
  }
  // THEN it follows.
  EXPECT_LE((filter_.predict(now_)->body_velocity_in_pad - (before.velocity - Eigen::Vector3d::Constant(1.5)))
                .norm(),
            0.6);
}

}  // namespace
}  // namespace perch
