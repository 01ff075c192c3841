#include "calib/mount/wander.h"

#include <gmock/gmock.h>

#include "mount_world.h"

namespace perch {
namespace {

using testing::HasSubstr;

Wander wander_of(const MountWorld& world, unsigned seed, MountOptions options = {}) {
  TestRng rng(seed);
  MountProblem p = world.problem(rng);
  p.options = options;
  return wander(p, solve_mount(p), 0);
}

TEST(Wander, IsNotSeenInNoise) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    const Wander w = wander_of(small_world(), seed);
    EXPECT_GT(w.piece, 2);
    // 30 numbers of each kind: a deviation scatters by 13 %.
    EXPECT_NEAR(w.position, 1, 0.5);
    EXPECT_NEAR(w.rotation, 1, 0.5);
    EXPECT_EQ(in_words(w), "");
  }
}

// A receiver that wanders by 1 cm beside 10 cm of noise a sample: too little for one picture, much for all.
TEST(Wander, IsSaidWithWhatWouldAccountForIt) {
  MountWorld world;
  world.camera_rate = 5;
  world.position_noise = 0.1;
  world.position_drift = 0.02;
  world.drift_time = 10;
  const Wander w = wander_of(world, 0);
  EXPECT_GT(w.position, 1.5);
  EXPECT_LT(w.rotation, 1.5);
  EXPECT_THAT(in_words(w), HasSubstr("{position_drift: 0.0"));
  MountOptions told;
  told.noise.position_drift = 0.02;
  told.noise.drift_time = 10;
  EXPECT_EQ(in_words(wander_of(world, 0, told)), "");
}

}  // namespace
}  // namespace perch
