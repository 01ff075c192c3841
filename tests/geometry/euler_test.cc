#include "perch/geometry/euler.h"

#include <limits>
#include <numbers>

#include "perch/geometry/so3.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

using std::numbers::pi;

MATCHER_P4(IsNearYpr, yaw, pitch, roll, tolerance, "") {
  *result_listener << arg.yaw << ", " << arg.pitch << ", " << arg.roll;
  return std::abs(arg.yaw - yaw) <= tolerance && std::abs(arg.pitch - pitch) <= tolerance &&
         std::abs(arg.roll - roll) <= tolerance;
}

TEST(Euler, YawTurnsXTowardsYPitchXAwayFromZRollYTowardsZ) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  EXPECT_THAT(rotation_from_ypr({pi / 2, 0, 0}) * x, IsNearMatrix(y, 4 * kEpsilon));
  EXPECT_THAT(rotation_from_ypr({0, pi / 2, 0}) * x, IsNearMatrix(-z, 4 * kEpsilon));
  EXPECT_THAT(rotation_from_ypr({0, 0, pi / 2}) * y, IsNearMatrix(z, 4 * kEpsilon));
}

TEST(Euler, RollActsFirstAndYawLast) {
  // y rolls to z, z pitches to x, x yaws to y.
  const Eigen::Vector3d y = rotation_from_ypr({pi / 2, pi / 2, pi / 2}) * Eigen::Vector3d::UnitY();
  EXPECT_THAT(y, IsNearMatrix(Eigen::Vector3d::UnitY(), 8 * kEpsilon));
}

TEST(Euler, AnglesComeBackFromTheRotation) {
  TestRng rng;
  for (int i = 0; i < 1000; ++i) {
    const YawPitchRoll a{rng.uniform(-pi, pi), rng.uniform(-1.5, 1.5), rng.uniform(-pi, pi)};
    // Rounding, over cos 1.5 = 0.07 where yaw and roll are hardest to tell apart.
    EXPECT_THAT(ypr_from_rotation(rotation_from_ypr(a)),
                IsNearYpr(a.yaw, a.pitch, a.roll, 16 * kEpsilon / 0.07));
  }
}

TEST(Euler, TinyAnglesComeBack) {
  EXPECT_THAT(ypr_from_rotation(rotation_from_ypr({1e-8, -2e-8, 3e-8})),
              IsNearYpr(1e-8, -2e-8, 3e-8, 4 * kEpsilon));
  EXPECT_THAT(ypr_from_rotation(Eigen::Quaterniond::Identity()), IsNearYpr(0, 0, 0, 0));
}

TEST(Euler, RotationComesBackAtEveryDistanceFromThePole) {
  TestRng rng;
  for (const double from_pole : {0.1, 1e-3, 1e-5, 1e-7, 1e-8, 2e-9}) {
    for (int i = 0; i < 100; ++i) {
      const double pitch = (i % 2 ? 1 : -1) * (pi / 2 - from_pole);
      const Eigen::Quaterniond q = rotation_from_ypr({rng.uniform(-pi, pi), pitch, rng.uniform(-pi, pi)});
      const YawPitchRoll angles = ypr_from_rotation(q);
      EXPECT_LE(rotation_from_ypr(angles).angularDistance(q), 32 * kEpsilon) << from_pole;
    }
  }
}

TEST(Euler, AtThePoleRollIsZeroAndYawTakesAll) {
  // Yaw and roll turn about one axis there: nose down adds them, nose up subtracts.
  EXPECT_THAT(ypr_from_rotation(rotation_from_ypr({0.7, pi / 2, 0.2})), IsNearYpr(0.5, pi / 2, 0, 1e-9));
  EXPECT_THAT(ypr_from_rotation(rotation_from_ypr({0.7, -pi / 2, 0.2})), IsNearYpr(0.9, -pi / 2, 0, 1e-9));
}

TEST(Euler, BothSignsOfAQuaternionHaveTheSameAngles) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Quaterniond q = rng.rotation();
    const YawPitchRoll a = ypr_from_rotation(q);
    EXPECT_THAT(ypr_from_rotation(Eigen::Quaterniond(-q.coeffs())), IsNearYpr(a.yaw, a.pitch, a.roll, 0));
  }
}

TEST(Euler, AHalfTurnIsPlusPiWhateverTheSignsOfItsZeros) {
  for (const double zero : {0.0, -0.0}) {
    EXPECT_EQ(ypr_from_rotation({zero, 0, 0, 1}).yaw, pi);
    EXPECT_EQ(ypr_from_rotation({zero, 1, 0, 0}).roll, pi);
    EXPECT_EQ(ypr_from_rotation({zero, 0, 0, -1}).yaw, pi);
    EXPECT_EQ(ypr_from_rotation({zero, -1, 0, 0}).roll, pi);
  }
}

TEST(Euler, NanComesOutAsNan) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const YawPitchRoll a = ypr_from_rotation({nan, nan, nan, nan});
  EXPECT_TRUE(std::isnan(a.yaw) && std::isnan(a.pitch) && std::isnan(a.roll));
  EXPECT_TRUE(std::isnan(wrap_angle(nan)));
}

TEST(Euler, WrappedAnglesLieAboveMinusPiUpToPi) {
  EXPECT_EQ(wrap_angle(pi), pi);
  EXPECT_EQ(wrap_angle(-pi), pi);
  EXPECT_EQ(wrap_angle(0.5), 0.5);
  EXPECT_EQ(wrap_angle(-3), -3);
  EXPECT_NEAR(wrap_angle(1.5 * pi), -0.5 * pi, 4 * kEpsilon);
  EXPECT_NEAR(wrap_angle(-1.5 * pi), 0.5 * pi, 4 * kEpsilon);
  // 100 turns: the rounding of 200 pi itself.
  EXPECT_NEAR(wrap_angle(200 * pi + 0.25), 0.25, 200 * pi * kEpsilon);
}

TEST(Euler, DegreesAndRadiansAreEachOthersInverse) {
  EXPECT_EQ(180 * kRadFromDeg, pi);
  EXPECT_EQ(pi * kDegFromRad, 180);
}

}  // namespace
}  // namespace perch
