#include "perch/geometry/rigid3.h"

#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

TEST(Rigid3, InverseUndoesTheMap) {
  TestRng rng;
  for (int i = 0; i < 1000; ++i) {
    const Rigid3 b_from_a = rng.pose(100);
    // Rounding alone: a few tens of epsilons of the largest number at hand, some 500 m.
    EXPECT_THAT(b_from_a * inverse(b_from_a), IsNearPose(Rigid3{}, 32 * kEpsilon, 32 * kEpsilon * 500));
    EXPECT_THAT(inverse(b_from_a) * b_from_a, IsNearPose(Rigid3{}, 32 * kEpsilon, 32 * kEpsilon * 500));
  }
}

TEST(Rigid3, ProductMapsAsItsFactorsInTurn) {
  TestRng rng;
  for (int i = 0; i < 1000; ++i) {
    const Rigid3 c_from_b = rng.pose(10), b_from_a = rng.pose(10);
    const Eigen::Vector3d p_a = rng.normal3(10);
    EXPECT_LE(((c_from_b * b_from_a) * p_a - c_from_b * (b_from_a * p_a)).norm(), 64 * kEpsilon * 100);
  }
}

TEST(Rigid3, RotatesBeforeItMoves) {
  const Rigid3 b_from_a{Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ())),
                        {10, 0, 0}};
  EXPECT_LE((b_from_a * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(10, 1, 0)).norm(), 10 * kEpsilon);
}

TEST(Rigid3, InterpolationGoesTheShorterWay) {
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()));
  const Rigid3 b{Eigen::Quaterniond(-quarter.coeffs()), {2, 0, 0}};  // the same rotation, the other sign
  const Rigid3 half = interpolate(Rigid3{}, b, 0.5);
  const Rigid3 expected{Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 4, Eigen::Vector3d::UnitX())), {1, 0, 0}};
  EXPECT_THAT(half, IsNearPose(expected, 10 * kEpsilon, 10 * kEpsilon));
}

TEST(Rigid3, PositiveWIsTheSameRotation) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Quaterniond q = rng.rotation();
    EXPECT_GE(positive_w(q).w(), 0);
    EXPECT_LE(positive_w(q).angularDistance(q), 10 * kEpsilon);
  }
}

}  // namespace
}  // namespace perch
