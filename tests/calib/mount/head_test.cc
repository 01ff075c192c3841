// Pan/tilt heads: the axes' zeros, scales, directions, lens-to-axis lever arms and the latency.

#include <gmock/gmock.h>

#include "calib/mount/mount_files.h"
#include "mount_world.h"
#include "support/near_pose.h"

namespace perch {
namespace {

MountWorld head_world() {
  MountWorld world;
  world.nominal_head.emplace();
  world.head.emplace();
  PanTilt& head = *world.head;
  head.pan.zero = 1.5 * kRadFromDeg;
  head.tilt.zero = -2 * kRadFromDeg;
  head.pan.scale = 1.02;
  head.tilt.scale = 0.98;
  head.pan.point = {0.01, 0, -0.04};
  head.tilt.point = {0, 0.015, -0.03};
  head.latency = 0.03;
  world.body_from_base = world.nominal;
  world.body_from_base.translation = {0.15, -0.05, 0.1};
  world.head_noise = 0.02 * kRadFromDeg;
  world.high = 5;
  return world;
}

TEST(Head, FindsTheZerosToATwentiethOfADegreeAndTheLatencyToTwoMilliseconds) {
  for (unsigned seed = 0; seed < 1; ++seed) {
    TestRng rng(seed);
    const MountWorld world = head_world();
    const MountProblem p = world.problem(rng);
    FrameChain frames;
    frames.body_from_base = world.nominal;
    frames.pan_tilt = world.nominal_head;
    const MountSolution s = solve_mount(p);
    const FrameChain found = calibrated_chain(frames, p, s);
    const PanTilt& head = *found.pan_tilt;
    EXPECT_NEAR(head.pan.zero, world.head->pan.zero, 0.05 * kRadFromDeg);
    EXPECT_NEAR(head.tilt.zero, world.head->tilt.zero, 0.05 * kRadFromDeg);
    EXPECT_NEAR(head.latency, 0.03, 0.002);
    EXPECT_NEAR(head.pan.scale, 1.02, 0.005);
    EXPECT_NEAR(head.tilt.scale, 0.98, 0.005);
    // Any angles: the camera is where it is.
    FrameChain truth;
    truth.body_from_base = world.body_from_base;
    truth.pan_tilt = world.head;
    for (const HeadAngles angles : {HeadAngles{0, 0}, HeadAngles{0.2, -0.15}}) {
      EXPECT_THAT(
          *found.body_from_base * base_from_camera(found, angles),
          IsNearPose(*truth.body_from_base * base_from_camera(truth, angles), 0.1 * kRadFromDeg, 0.02));
    }
    const auto json = mount_json(found, p, s, {});
    EXPECT_NEAR(json["pan_tilt"]["tilt"]["zero_deg"].get<double>(), -2, 0.05);
    EXPECT_EQ(json["parameters"].size(), 13u + kHeadSize);
    const FrameChain read = read_frame_chain(Section::parse(mount_yaml(found, p, s), "mount.yaml"));
    EXPECT_THAT(
        *read.body_from_base * base_from_camera(read, HeadAngles{0.1, 0.1}),
        IsNearPose(*found.body_from_base * base_from_camera(found, HeadAngles{0.1, 0.1}), 1e-5, 1e-4));
  }
}

}  // namespace
}  // namespace perch
