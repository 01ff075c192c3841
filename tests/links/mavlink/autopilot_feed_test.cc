#include "perch/links/mavlink/autopilot_feed.h"

#include <gtest/gtest.h>

#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;
// A float's unit quaternion.
constexpr double kFloatAngle = 4e-7;

void add_attitude(VehicleHistory& history, const Eigen::Quaterniond& q, int64_t time_ns, float yaw_rate = 0) {
  const Eigen::Quaternionf f = q.cast<float>();
  EXPECT_TRUE(history.add(AttitudeQuaternion{0, f.w(), f.x(), f.y(), f.z(), 0, 0, yaw_rate, {}}, time_ns));
}

void add_motion(VehicleHistory& history, float velocity, int64_t time_ns) {
  EXPECT_TRUE(history.add(LocalPositionNed{0, 0, 0, 0, velocity, 0, 0}, time_ns));
}

TEST(AutopilotFeed, GivesEachSampleOnceInTheOrderOfTheirTimes) {
  VehicleHistory history;
  AutopilotFeed feed;
  EXPECT_TRUE(feed.take(history).empty());
  const Eigen::Quaterniond q = so3_exp({0.1, -0.2, 0.3});
  add_attitude(history, q, 1000 * kMs, 0.5f);
  add_attitude(history, q, 1020 * kMs);
  add_motion(history, 3, 1010 * kMs);
  const auto samples = feed.take(history);
  ASSERT_EQ(samples.size(), 3u);
  EXPECT_EQ(samples[0].timestamp_ns, 1000 * kMs);
  EXPECT_LT(samples[0].world_from_body->angularDistance(q), kFloatAngle);
  EXPECT_EQ(samples[0].angular_velocity_in_body->z(), 0.5);
  EXPECT_FALSE(samples[0].body_velocity_in_world);
  EXPECT_EQ(samples[1].timestamp_ns, 1010 * kMs);
  EXPECT_FALSE(samples[1].world_from_body);
  EXPECT_EQ(samples[1].body_velocity_in_world->x(), 3);
  EXPECT_EQ(samples[2].timestamp_ns, 1020 * kMs);
  EXPECT_TRUE(feed.take(history).empty());
  add_attitude(history, q, 1040 * kMs);
  EXPECT_EQ(feed.take(history).size(), 1u);
}

TEST(AutopilotFeed, AFloodIsThinned) {
  VehicleHistory history;
  AutopilotFeed feed;
  size_t taken = 0;
  for (int64_t i = 1; i <= 400; ++i) {  // a second at 400 Hz, taken at 33 Hz
    add_attitude(history, Eigen::Quaterniond::Identity(), i * 2'500'000);
    if (i % 12 == 0) taken += feed.take(history).size();
  }
  EXPECT_LE(taken, 61u);
  EXPECT_GE(taken, 50u);  // every seventh of 400
}

TEST(AutopilotFeed, AClockThatWasSetDoesNotStopIt) {
  VehicleHistory history;
  AutopilotFeed feed;
  add_attitude(history, Eigen::Quaterniond::Identity(), 1000 * kMs);
  EXPECT_EQ(feed.take(history).size(), 1u);
  history.clear();
  EXPECT_TRUE(feed.take(history).empty());
  add_attitude(history, Eigen::Quaterniond::Identity(), 1050 * kMs);
  EXPECT_EQ(feed.take(history).size(), 1u);
}

TEST(AutopilotFeed, ACameraClockThatIsOffIsAllowedFor) {
  VehicleHistory history;
  const AutopilotFeed still(0);
  AutopilotFeed feed(0.03);  // the camera's clock is 30 ms ahead
  for (int64_t ms = 1000; ms <= 1100; ms += 10)
    add_attitude(history, so3_exp({0, 0, 0.001 * static_cast<double>(ms - 1000)}), ms * kMs);
  // What the camera calls 1080 is 1050.
  EXPECT_LT(feed.attitude_at(history, 1080 * kMs)->angularDistance(so3_exp({0, 0, 0.05})), kFloatAngle);
  EXPECT_LT(still.attitude_at(history, 1080 * kMs)->angularDistance(so3_exp({0, 0, 0.08})), kFloatAngle);
  EXPECT_EQ(feed.take(history).front().timestamp_ns, 1030 * kMs);
  EXPECT_FALSE(feed.attitude_at(history, 1020 * kMs));
}

// A head under a vehicle that banks and turns: what the gimbal says against heading and horizon gives the
// angles that the chain turns the camera by.
TEST(AutopilotFeed, AGimbalsAttitudeIsTheHeadsAngles) {
  FrameChain chain;
  chain.pan_tilt = PanTilt{};
  Eigen::Matrix3d frd_from_camera;
  frd_from_camera << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  chain.body_from_base.emplace().rotation =
      Eigen::Quaterniond(frd_from_camera) * so3_exp({0.02, -0.03, 0.01});
  const AutopilotFeed feed;
  TestRng rng(1);
  for (int i = 0; i < 200; ++i) {
    const HeadAngles truth{rng.uniform(-2, 2), rng.uniform(-1.5, 0.5)};
    const Eigen::Quaterniond ned_from_body = so3_exp(rng.normal3(0.3));
    const Eigen::Vector3d nose = ned_from_body * Eigen::Vector3d::UnitX();
    const Eigen::Quaterniond heading(
        Eigen::AngleAxisd(std::atan2(nose.y(), nose.x()), Eigen::Vector3d::UnitZ()));
    const Eigen::Quaterniond ned_from_camera =
        ned_from_body * chain.body_from_base->rotation * base_from_camera(chain, truth).rotation;
    const Eigen::Quaterniond told =
        heading.conjugate() * ned_from_camera * Eigen::Quaterniond(frd_from_camera).conjugate();
    VehicleHistory history;
    add_attitude(history, ned_from_body, 1000 * kMs);
    GimbalDeviceAttitudeStatus status;
    const Eigen::Quaternionf f = told.cast<float>();
    status.q = {f.w(), f.x(), f.y(), f.z()};
    status.flags = 32;  // GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
    ASSERT_TRUE(history.add(status, 154, 1000 * kMs));
    const auto angles = feed.head_angles_at(history, chain, 1010 * kMs);
    ASSERT_TRUE(angles);
    EXPECT_NEAR(angles->pan, truth.pan, 3 * kFloatAngle);
    EXPECT_NEAR(angles->tilt, truth.tilt, 3 * kFloatAngle);
    EXPECT_FALSE(feed.head_angles_at(history, chain, 1101 * kMs));  // too long ago
  }
  // A third axis keeps the horizon: two angles cannot tell of it.
  VehicleHistory history;
  add_attitude(history, so3_exp({0.2, 0, 0}), 1000 * kMs);
  GimbalDeviceAttitudeStatus level;
  level.q = {1, 0, 0, 0};
  level.flags = 32;
  ASSERT_TRUE(history.add(level, 154, 1000 * kMs));
  EXPECT_FALSE(feed.head_angles_at(history, chain, 1000 * kMs));
}

}  // namespace
}  // namespace perch::mavlink
