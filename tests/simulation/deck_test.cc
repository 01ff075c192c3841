#include "perch/simulation/deck.h"

#include <gmock/gmock.h>

#include <cmath>

#include "perch/geometry/so3.h"
#include "support/near_pose.h"

namespace perch {
namespace {

const Rigid3 kAtRest{Eigen::Quaterniond(0.1, 0.9, 0.3, -0.2).normalized(), {12, -7, -4}};

TEST(Deck, WithoutOneThePadStaysWhereItIs) {
  const Deck deck(std::nullopt, kAtRest, 1);
  EXPECT_FALSE(deck.moves());
  for (const double t : {-1.0, 0.0, 100.0}) {
    const PadTruth pad = deck.at(t);
    EXPECT_THAT(pad.world_from_pad, IsNearPose(kAtRest, 0.0, 0.0));
    EXPECT_EQ(pad.pad_velocity_in_world.norm(), 0);
    EXPECT_EQ(pad.angular_velocity_in_pad.norm(), 0);
  }
}

TEST(Deck, VelocitiesAreTheDerivativesOfThePose) {
  const Deck deck(DeckOptions{}, kAtRest, 3);
  for (double t = 0; t < 30; t += 0.7) {
    // Central differences: the motion's third derivative, some 1 m/s^3, times h^2 / 6; and rounding of 10 m
    // over h.
    constexpr double h = 1e-4;
    const PadTruth before = deck.at(t - h), now = deck.at(t), after = deck.at(t + h);
    const Eigen::Vector3d velocity =
        (after.world_from_pad.translation - before.world_from_pad.translation) / (2 * h);
    EXPECT_THAT(now.pad_velocity_in_world, IsNearMatrix(velocity, 1e-8));
    const Eigen::Vector3d turn =
        so3_log(before.world_from_pad.rotation.conjugate() * after.world_from_pad.rotation) / (2 * h);
    EXPECT_THAT(now.angular_velocity_in_pad, IsNearMatrix(turn, 1e-8));
  }
}

TEST(Deck, MovesAsFarAndAsFastAsItIsTold) {
  DeckOptions options;
  double heave = 0, sway = 0, tilt = 0, heave_rate = 0;
  int count = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const Deck deck(options, Rigid3{}, seed);
    for (double t = 0; t < 600; t += 1.7) {
      const PadTruth pad = deck.at(t);
      heave += std::pow(pad.world_from_pad.translation.z(), 2);
      sway += std::pow(pad.world_from_pad.translation.x(), 2);
      EXPECT_EQ(pad.world_from_pad.translation.y(), 0);
      tilt += (pad.world_from_pad.rotation * Eigen::Vector3d::UnitZ()).head<2>().squaredNorm();
      heave_rate += std::pow(pad.pad_velocity_in_world.z(), 2);
      ++count;
    }
  }
  // Sines have their deviation exactly; ten minutes of beating leave 1 %.
  EXPECT_NEAR(std::sqrt(heave / count), options.heave, 0.02 * options.heave);
  EXPECT_NEAR(std::sqrt(sway / count), options.sway, 0.02 * options.sway);
  EXPECT_NEAR(std::sqrt(tilt / count), std::hypot(options.roll, options.pitch), 0.001);
  // The mean period of a Bretschneider spectrum, m0 to m2, is 0.710 of the modal one; less its shortest
  // waves, which are cut, 3 to 8 % longer.
  const double period = 2 * M_PI * std::sqrt(heave / heave_rate);
  EXPECT_GT(period, 0.71 * options.period);
  EXPECT_LT(period, 0.78 * options.period);
}

TEST(Deck, RollTurnsAboutTheBowAndPitchAboutStarboard) {
  DeckOptions only_roll;
  only_roll.heave = only_roll.sway = only_roll.pitch = 0;
  DeckOptions only_pitch;
  only_pitch.heave = only_pitch.sway = only_pitch.roll = 0;
  for (double t = 0; t < 20; t += 1) {
    const auto rolled = Deck(only_roll, Rigid3{}, 1).at(t).world_from_pad.rotation;
    EXPECT_THAT(rolled * Eigen::Vector3d::UnitY(),
                IsNearMatrix(Eigen::Vector3d(Eigen::Vector3d::UnitY()), 1e-15));
    const auto pitched = Deck(only_pitch, Rigid3{}, 1).at(t).world_from_pad.rotation;
    EXPECT_THAT(pitched * Eigen::Vector3d::UnitX(),
                IsNearMatrix(Eigen::Vector3d(Eigen::Vector3d::UnitX()), 1e-15));
  }
}

TEST(Deck, SameSeedSameMotion) {
  const Deck one(DeckOptions{}, kAtRest, 5), again(DeckOptions{}, kAtRest, 5),
      other(DeckOptions{}, kAtRest, 6);
  EXPECT_EQ(one.at(7).world_from_pad.translation, again.at(7).world_from_pad.translation);
  EXPECT_NE(one.at(7).world_from_pad.translation, other.at(7).world_from_pad.translation);
}

}  // namespace
}  // namespace perch
