#include "perch/frames/frame_chain.h"

#include <limits>
#include <numbers>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "support/config_error.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

FrameChain read(const std::string& text) { return read_frame_chain(Section::parse(text, "run.yaml")); }

FrameChain head() {
  FrameChain chain;
  chain.pan_tilt = PanTilt{};
  return chain;
}

// Where a target 10 m in front of the base appears in the picture of a camera of focal length 1: x right, y
// down.
Eigen::Vector2d target_in_picture(const HeadAngles& angles) {
  const Rigid3 camera_from_base = inverse(base_from_camera(head(), angles));
  return (camera_from_base * Eigen::Vector3d(0, 0, 10)).hnormalized();
}

TEST(FrameChain, PositivePanMovesTheTargetLeftInThePicture) {
  const Eigen::Vector2d target = target_in_picture({.pan = 0.1});
  EXPECT_NEAR(target.x(), -std::tan(0.1), 8 * kEpsilon);
  EXPECT_NEAR(target.y(), 0, 8 * kEpsilon);
}

TEST(FrameChain, PositiveTiltMovesTheTargetDownInThePicture) {
  const Eigen::Vector2d target = target_in_picture({.tilt = 0.1});
  EXPECT_NEAR(target.x(), 0, 8 * kEpsilon);
  EXPECT_NEAR(target.y(), std::tan(0.1), 8 * kEpsilon);
}

TEST(FrameChain, TiltAxisMovesWithThePan) {
  // Panned right by a quarter turn, the camera looks along the base's x; tilted up by 0.1 it looks above it.
  const Rigid3 camera = base_from_camera(head(), HeadAngles{.pan = pi / 2, .tilt = 0.1});
  EXPECT_THAT(camera.rotation * Eigen::Vector3d::UnitZ(),
              IsNearMatrix(Eigen::Vector3d(std::cos(0.1), -std::sin(0.1), 0), 8 * kEpsilon));
  // Its picture stays level: the x axis has no part of the base's y.
  EXPECT_NEAR((camera.rotation * Eigen::Vector3d::UnitX()).y(), 0, 8 * kEpsilon);
}

TEST(FrameChain, HeadTurnsAboutItsOpticalCentre) {
  FrameChain chain = head();
  chain.pan_tilt->base_from_zero = {rotation_from_ypr({0.1, 0.2, 0.3}), {1, 2, 3}};
  const Rigid3 turned = base_from_camera(chain, HeadAngles{0.4, -0.5});
  EXPECT_EQ(turned.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(base_from_camera(chain, HeadAngles{}),
              IsNearPose(chain.pan_tilt->base_from_zero, 8 * kEpsilon, 0.0));
  // A frame without angles counts as one at zero.
  EXPECT_THAT(base_from_camera(chain, {}), IsNearPose(chain.pan_tilt->base_from_zero, 8 * kEpsilon, 0.0));
}

TEST(FrameChain, FixedCameraDoesNotAskForAngles) {
  FrameChain chain;
  chain.base_from_camera = {rotation_from_ypr({1, 0, 0}), {1, 2, 3}};
  EXPECT_THAT(base_from_camera(chain, HeadAngles{0.5, 0.5}), IsNearPose(chain.base_from_camera, 0.0, 0.0));
}

TEST(FrameChain, VisionOfACameraLookingStraightDownByHand) {
  // A UAV 5 m above the pad, heading along the pad's y (up on the print), its camera 0.2 m ahead of the
  // body's origin, the picture's upper edge ahead. Body FRD: x ahead, y right, z down.
  FrameChain chain;
  const Eigen::Matrix3d ahead_is_minus_y =
      (Eigen::Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished();  // body_from_camera
  chain.body_from_base = Rigid3{Eigen::Quaterniond(ahead_is_minus_y), {0.2, 0, 0}};
  // The pad's y is up on the print, the picture's down; z out of the face is towards the camera.
  const Rigid3 camera_from_target{Eigen::Quaterniond(0, 1, 0, 0), {0, 0, 5}};
  const Rigid3 pad_from_body = pad_from_body_by_vision(chain, {camera_from_target}).mean;
  EXPECT_THAT(pad_from_body.translation, IsNearMatrix(Eigen::Vector3d(0, -0.2, 5), 8 * kEpsilon * 5));
  EXPECT_THAT(pad_from_body.rotation * Eigen::Vector3d::UnitX(),
              IsNearMatrix(Eigen::Vector3d::UnitY(), 8 * kEpsilon));
  EXPECT_THAT(pad_from_body.rotation * Eigen::Vector3d::UnitZ(),
              IsNearMatrix(-Eigen::Vector3d::UnitZ(), 8 * kEpsilon));
}

TEST(FrameChain, VisionAndNavigationAgreeInOneWorld) {
  // What the camera sees is made from where the body is: both ways round the chain must come to the same.
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    FrameChain chain;
    chain.target_from_pad = rng.pose(1);
    chain.base_from_camera = rng.pose(1);
    if (i % 2) chain.pan_tilt = PanTilt{rng.pose(1)};
    chain.body_from_base = rng.pose(1);
    chain.world_from_pad = rng.pose(10);
    const HeadAngles angles{rng.normal(), rng.normal()};
    const Rigid3 world_from_body = rng.pose(10);

    const Rigid3 world_from_camera =
        world_from_body * *chain.body_from_base * base_from_camera(chain, angles);
    const Rigid3 world_from_target = *chain.world_from_pad * inverse(chain.target_from_pad);
    const Rigid3 camera_from_target = inverse(world_from_camera) * world_from_target;

    const auto by_navigation = pad_from_body_by_navigation(chain, world_from_body);
    ASSERT_TRUE(by_navigation);
    // Nine products of some 50 m.
    EXPECT_THAT(pad_from_body_by_vision(chain, {camera_from_target}, angles).mean,
                IsNearPose(*by_navigation, 64 * kEpsilon, 64 * kEpsilon * 50));
  }
}

TEST(FrameChain, TheWayBackUndoesTheWayThereUncertaintyAndAll) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    FrameChain chain;
    chain.target_from_pad = rng.pose(1);
    chain.pan_tilt = PanTilt{rng.pose(1)};
    chain.body_from_base = rng.pose(1);
    const HeadAngles angles{rng.normal(), rng.normal()};
    UncertainRigid3 seen{rng.pose(5)};
    seen.covariance.diagonal() << 1, 2, 3, 0.1, 0.2, 0.3;
    const UncertainRigid3 back =
        camera_from_target_of(chain, pad_from_body_by_vision(chain, seen, angles), angles);
    EXPECT_THAT(back.mean, IsNearPose(seen.mean, 64 * kEpsilon, 64 * kEpsilon * 20));
    // Squares of lever arms of some 20 m, there and back.
    EXPECT_THAT(back.covariance, IsNearMatrix(seen.covariance, 64 * kEpsilon * 400));
  }
}

TEST(FrameChain, LevelNormalIsTheTargetsOwnWhereItsPlaceIsKnown) {
  TestRng rng;
  FrameChain chain;
  chain.target_from_pad = rng.pose(1);
  chain.body_from_base = rng.pose(1);
  chain.world_from_pad = rng.pose(10);
  const Rigid3 world_from_body = rng.pose(10);
  const Rigid3 camera_from_target = inverse(world_from_body * *chain.body_from_base) * *chain.world_from_pad *
                                    inverse(chain.target_from_pad);
  const auto normal = level_normal_in_camera(chain, world_from_body.rotation);
  ASSERT_TRUE(normal);
  EXPECT_THAT(*normal, IsNearMatrix(camera_from_target.rotation * Eigen::Vector3d::UnitZ(), 32 * kEpsilon));
}

TEST(FrameChain, LevelNormalPointsAtACameraThatLooksDownWhetherTheWorldsZIsUpOrDown) {
  const Eigen::Quaterniond ned = rotation_from_ypr({0.3, 0, 0}), enu(0, 1, 0, 0);
  for (const auto& world_from_camera : {ned, enu}) {
    const auto normal = level_normal_in_camera(FrameChain{}, world_from_camera);
    ASSERT_TRUE(normal);
    EXPECT_THAT(*normal, IsNearMatrix(Eigen::Vector3d(0, 0, -1), 8 * kEpsilon));
  }
}

TEST(FrameChain, LevelNormalIsUnknownNearTheHorizonAndWithoutAnAttitude) {
  const auto looking_down_by = [](double angle) { return so3_exp({pi / 2 - angle, 0, 0}); };
  EXPECT_TRUE(level_normal_in_camera(FrameChain{}, looking_down_by(21 * kRadFromDeg)));
  EXPECT_FALSE(level_normal_in_camera(FrameChain{}, looking_down_by(19 * kRadFromDeg)));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  FrameChain chain;
  EXPECT_FALSE(level_normal_in_camera(chain, {nan, 0, 0, 1}));
  chain.world_from_pad = Rigid3{};
  EXPECT_FALSE(level_normal_in_camera(chain, {nan, 0, 0, 1}));
}

TEST(FrameChain, CameraUncertaintyArrivesInThePadFrame) {
  // The camera is sure of all but the distance, along its z. Looking straight down that is the pad's z.
  FrameChain chain;
  chain.body_from_base = Rigid3{Eigen::Quaterniond::Identity(), {0.2, 0, 0}};
  UncertainRigid3 camera_from_target{{Eigen::Quaterniond(0, 1, 0, 0), {0, 0, 5}}};
  camera_from_target.covariance(2, 2) = 0.04;
  PoseCovariance expected = PoseCovariance::Zero();
  expected(2, 2) = 0.04;
  EXPECT_THAT(pad_from_body_by_vision(chain, camera_from_target).covariance,
              IsNearMatrix(expected, 8 * kEpsilon));
  // A turn about the camera's x by 0.01 rad, the target 5 m away, puts the camera 0.05 m off along y.
  camera_from_target.covariance.setZero();
  camera_from_target.covariance(3, 3) = 1e-4;
  const PoseCovariance C = pad_from_body_by_vision(chain, camera_from_target).covariance;
  EXPECT_NEAR(C(1, 1), 0.0025, 8 * kEpsilon);
  EXPECT_NEAR(C(3, 3), 1e-4, 8 * kEpsilon);
}

TEST(FrameChain, NavigationSaysNothingWithoutAPadInItsWorld) {
  EXPECT_FALSE(pad_from_body_by_navigation(FrameChain{}, Rigid3{}));
}

TEST(FrameChain, NavigationTimeIsCameraTimeLessTheOffset) {
  constexpr int64_t kEpoch = 1700000000123456789;  // more digits than a double has
  FrameChain chain;
  EXPECT_EQ(navigation_time_ns(chain, kEpoch), kEpoch);
  // 1.001 * 1e9 is a little below 1001000000 in binary: cut off it would be 1 ns short.
  for (const int64_t ms : {1, 1001, -1001, 86400000}) {
    chain.time_offset = static_cast<double>(ms) / 1000;
    EXPECT_EQ(navigation_time_ns(chain, kEpoch), kEpoch - ms * 1000000) << ms;
  }
}

TEST(FrameChain, ReadsAnEmptySectionAsACameraAtTheBody) {
  const FrameChain chain = read("");
  EXPECT_FALSE(chain.pan_tilt || chain.body_from_base || chain.world_from_pad);
  EXPECT_EQ(chain.time_offset, 0);
}

TEST(FrameChain, ReadsAFixedCamera) {
  const FrameChain chain = read(
      "base_from_camera: {position: [1, 2, 3]}\n"
      "body_from_base: {position: [0.1, 0, 0.05], rotation: {ypr_deg: [3, 10, 0]}}\n"
      "target_from_pad: identity\nworld_from_pad: {position: [7, 8, 9]}\ntime_offset: -0.02\n");
  EXPECT_EQ(chain.base_from_camera.translation, Eigen::Vector3d(1, 2, 3));
  ASSERT_TRUE(chain.body_from_base && chain.world_from_pad);
  EXPECT_LE(chain.body_from_base->rotation.angularDistance(
                rotation_from_ypr({3 * kRadFromDeg, 10 * kRadFromDeg, 0})),
            8 * kEpsilon);
  EXPECT_EQ(chain.world_from_pad->translation, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(chain.time_offset, -0.02);
}

TEST(FrameChain, ReadsAPanTiltHead) {
  const FrameChain chain = read("base_from_camera: {pan_tilt: {base_from_zero: {position: [0, 0, 1]}}}\n");
  ASSERT_TRUE(chain.pan_tilt);
  EXPECT_EQ(chain.pan_tilt->base_from_zero.translation, Eigen::Vector3d(0, 0, 1));
  EXPECT_TRUE(read("base_from_camera: {pan_tilt: }\n").pan_tilt);
}

TEST(FrameChain, RefusesWhatItDoesNotKnow) {
  const auto error = [](const std::string& text) { return config_error([&] { read(text); }); };
  EXPECT_THAT(error("body_from_camera: identity\n"),
              HasSubstr("run.yaml:1: body_from_camera: expected one of"));
  EXPECT_THAT(error("base_from_camera: {pan_tilt: {}, position: [0, 0, 0]}\n"),
              HasSubstr("base_from_camera.position: expected one of pan_tilt, found an unknown key"));
  EXPECT_THAT(error("base_from_camera: {pan_tilt: {pan: 3}}\n"),
              HasSubstr("base_from_camera.pan_tilt.pan: "));
  EXPECT_THAT(error("time_offset: 1700000000\n"), HasSubstr("expected a number between -86400 and 86400"));
}

TEST(FrameChain, ResolvedIsReadAgainAsTheSame) {
  for (const char* text :
       {"", "base_from_camera: {pan_tilt: {base_from_zero: {rotation: {ypr_deg: [1, 2, 3]}}}}\n",
        "body_from_base: {rotation: {ypr_deg: [190, 2, 3]}}\nworld_from_pad: identity\n"}) {
    const Section first = Section::parse(text, "run.yaml");
    read_frame_chain(first);
    const Section second = Section::parse(first.resolved(), "run.yaml");
    read_frame_chain(second);
    EXPECT_EQ(second.resolved(), first.resolved());
  }
}

TEST(FrameChain, NanInNanOut) {
  FrameChain chain;
  Rigid3 camera_from_target;
  camera_from_target.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(pad_from_body_by_vision(chain, {camera_from_target}).mean.translation.allFinite());
}

}  // namespace
}  // namespace perch
