#include "calib/mount/sight_chain.h"

#include <gmock/gmock.h>

#include "mount_world.h"
#include "support/near_pose.h"

namespace perch {
namespace {

// Each derivative against central differences; an error of the other side or sign is of order 1.
TEST(SightChain, ItsDerivativesAreThoseOfThePrediction) {
  TestRng rng;
  MountWorld world;
  world.duration = 3;
  world.head.emplace();
  const MountFlight flight = world.flight(rng);
  FrameChain frames;
  frames.pan_tilt.emplace();
  frames.pan_tilt->pan.point = {0.02, 0, -0.03};
  frames.pan_tilt->tilt.zero = 0.2;
  frames.target_from_pad = rng.pose(0.2);
  const MountChain chain = mount_chain(frames);
  const Trajectory trajectory(flight.nav);
  const SightInputs in{chain, trajectory, flight.gimbal, flight.sightings[20].timestamp_ns};
  const Rigid3 mount = rng.pose(0.3), pad = rng.pose(2);
  HeadVector head;
  for (int i = 0; i < kHeadSize; ++i) head[i] = rng.normal(0.01);
  Vector6d c;
  c << rng.normal3(0.02), rng.normal3(0.01);
  const auto at = predict_sight(in, mount, pad, 0.03, head, c);
  ASSERT_TRUE(at);
  const auto column = [&](auto predicted, double step) -> Vector6d {
    return pose_error(predicted(-step)->camera_from_target, predicted(step)->camera_from_target) / (2 * step);
  };
  for (int k = 0; k < 6; ++k) {
    const auto moved = [&](double h) -> PoseError { return h * PoseError::Unit(k); };
    EXPECT_THAT(
        at->by_mount.col(k),
        IsNearMatrix(
            column([&](double h) { return predict_sight(in, perturb(mount, moved(h)), pad, 0.03, head, c); },
                   1e-5),
            1e-7));
    EXPECT_THAT(
        at->by_pad.col(k),
        IsNearMatrix(
            column([&](double h) { return predict_sight(in, mount, perturb(pad, moved(h)), 0.03, head, c); },
                   1e-5),
            1e-7));
    EXPECT_THAT(
        at->by_correction.col(k),
        IsNearMatrix(
            column([&](double h) { return predict_sight(in, mount, pad, 0.03, head, c + moved(h)); }, 1e-5),
            1e-7));
  }
  for (int k = 0; k < kHeadSize; ++k) {
    const double step = k == kHeadSize - 1 ? 1e-3 : 1e-5;
    EXPECT_THAT(at->by_head.col(k), IsNearMatrix(column(
                                                     [&](double h) {
                                                       return predict_sight(
                                                           in, mount, pad, 0.03,
                                                           HeadVector(head + h * HeadVector::Unit(k)), c);
                                                     },
                                                     step),
                                                 1e-6))
        << k;
  }
  EXPECT_THAT(
      at->by_offset,
      IsNearMatrix(column([&](double h) { return predict_sight(in, mount, pad, 0.03 + h, head, c); }, 1e-4),
                   1e-5));
}

// The zeros and base_from_zero that go into the mount turn the camera as before.
TEST(SightChain, AHeadWithoutItsZerosIsTheSameHead) {
  TestRng rng;
  for (const HeadOrder order : {HeadOrder::kPanCarriesTilt, HeadOrder::kTiltCarriesPan}) {
    FrameChain frames;
    frames.body_from_base = rng.pose(1);
    frames.pan_tilt.emplace();
    frames.pan_tilt->base_from_zero = rng.pose(1);
    frames.pan_tilt->order = order;
    for (HeadAxis* axis : {&frames.pan_tilt->pan, &frames.pan_tilt->tilt}) {
      *axis = {rng.normal3().normalized(), rng.normal3(0.1), rng.uniform(0.9, 1.1), rng.uniform(-1, 1)};
    }
    const HeadAngles angles{0.3, -0.7};
    const std::vector<GimbalSample> gimbal = {{0, angles.pan, angles.tilt, 0}};
    const auto camera =
        body_from_camera(mount_chain(frames), nominal_mount(frames), HeadVector::Zero(), gimbal, 0);
    ASSERT_TRUE(camera);
    EXPECT_THAT(*camera, IsNearPose(*frames.body_from_base * base_from_camera(frames, angles), 1e-12, 1e-12));
  }
}

}  // namespace
}  // namespace perch
