#include "calib/mount/observability.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>

#include "calib/mount/mount_files.h"
#include "calib/mount/read_mount.h"
#include "mount_world.h"
#include "support/near_pose.h"

namespace perch {
namespace {

using testing::HasSubstr;

const Untold* find(const std::vector<Untold>& all, const std::string& what) {
  for (const Untold& u : all) {
    if (u.what == what) return &u;
  }
  return nullptr;
}

TEST(Observability, AFlightWithAllMotionsTellsEverything) {
  TestRng rng;
  MountWorld world = small_world();
  const MountProblem p = world.problem(rng);
  EXPECT_TRUE(untold(solve_mount(p), p.options).empty());
}

// Turning about the vertical alone: the lever arm's height and the pad's are one.
TEST(Observability, YawOnlyLeavesTheVerticalLeverArmUntold) {
  TestRng rng;
  MountWorld world;
  world.duration = 30;
  world.roll_pitch = 0;
  const MountProblem p = world.problem(rng);
  const auto all = untold(solve_mount(p), p.options);
  const Untold* z = find(all, "lever arm z");
  ASSERT_TRUE(z);
  EXPECT_THAT(z->trades, HasSubstr("pad z"));
  EXPECT_THAT(in_words(*z), HasSubstr("roll and pitch"));
  EXPECT_FALSE(find(all, "lever arm x"));
  EXPECT_FALSE(find(all, "mount rotation z"));
}

TEST(Observability, TranslationOnlyLeavesTheWholeLeverArmUntoldUnlessAPriorTellsIt) {
  TestRng rng;
  MountWorld world = small_world();
  world.roll_pitch = world.yaw_amplitude = 0;
  MountProblem p = world.problem(rng);
  const auto all = untold(solve_mount(p), p.options);
  for (const char* name : {"lever arm x", "lever arm y", "lever arm z"}) EXPECT_TRUE(find(all, name)) << name;
  EXPECT_FALSE(find(all, "mount rotation z"));
  p.options.priors.body_from_base = PosePrior{world.body_from_base, Eigen::Vector3d::Constant(0.01)};
  const MountSolution s = solve_mount(p);
  EXPECT_TRUE(untold(s, p.options).empty());
  EXPECT_THAT(s.state.mount, IsNearPose(world.body_from_base, 0.2 * kRadFromDeg, 0.03));
}

// What is written is what a configuration reads.
TEST(MountFiles, TheMountIsAFramesSection) {
  TestRng rng;
  MountWorld world;
  world.duration = 20;
  const MountProblem p = world.problem(rng);
  const MountSolution s = solve_mount(p);
  const FrameChain chain = calibrated_chain({}, p, s);
  const FrameChain read = read_frame_chain(Section::parse(mount_yaml(chain, p, s), "mount.yaml"));
  EXPECT_THAT(*read.body_from_base, IsNearPose(s.state.mount, 1e-7, 1e-5));
  EXPECT_THAT(*read.world_from_pad, IsNearPose(s.state.pads[0], 1e-7, 1e-5));
  EXPECT_NEAR(read.time_offset, s.state.offsets[0], 1e-6);
}

TEST(ReadMount, ReadsPriorsAndRefusesOnesThatSayNothing) {
  const MountOptions o = read_mount_options(Section::parse(
      "prior: {body_from_base: {mean: {position: [0.1, 0, 0]}, position_sigma: [0.01, 0.01, 0]}}\n"
      "navigation: {position_sigma: 0.02}\n",
      "c.yaml"));
  ASSERT_TRUE(o.priors.body_from_base);
  EXPECT_EQ(o.priors.body_from_base->position_sigma.x(), 0.01);
  EXPECT_TRUE(std::isinf(o.priors.body_from_base->position_sigma.z()));
  EXPECT_EQ(o.noise.position, 0.02);
  EXPECT_TRUE(std::isnan(o.noise.rotation));
  EXPECT_THROW(read_mount_options(Section::parse("prior: {world_from_pad: {}}\n", "c.yaml")), ConfigError);
  EXPECT_THROW(read_mount_options(Section::parse("limit: {}\n", "c.yaml")), ConfigError);
}

}  // namespace
}  // namespace perch
