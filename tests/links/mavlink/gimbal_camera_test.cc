#include "perch/links/mavlink/gimbal_camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "perch/frames/frame_chain.h"
#include "perch/geometry/euler.h"
#include "perch/links/mavlink/numbers.h"
#include "support/rng.h"

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr double kDeg = kRadFromDeg;
using Kind = HeadGoal::Kind;

void tell_attitude(VehicleHistory& history, int64_t t, const Eigen::Quaterniond& q) {
  AttitudeQuaternion m;
  m.q1 = static_cast<float>(q.w());
  m.q2 = static_cast<float>(q.x());
  m.q3 = static_cast<float>(q.y());
  m.q4 = static_cast<float>(q.z());
  history.add(m, t);
}

void tell_gimbal(VehicleHistory& history, int64_t t, const Eigen::Quaterniond& q, uint16_t flags) {
  GimbalDeviceAttitudeStatus m;
  m.q = {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
         static_cast<float>(q.z())};
  m.flags = flags;
  history.add(m, 154, t);
}

GimbalCamera controlled(const VehicleHistory& history) {
  GimbalCamera camera({}, history);
  camera.tick(kMs);
  CommandAck ack;
  ack.command = mav_command::kGimbalManagerConfigure;
  ack.result = mav_result::kAccepted;
  camera.receive(ack);
  return camera;
}

TEST(GimbalCamera, TakesControlBeforeItMoves) {
  const VehicleHistory history;
  GimbalCamera camera({}, history);
  camera.point({Kind::kDrive, 0.5, -0.25});
  const auto first = camera.tick(1000 * kMs);
  ASSERT_TRUE(first.command);
  EXPECT_FALSE(first.set);
  EXPECT_EQ(first.command->command, 1001);
  EXPECT_EQ(first.command->param1, 1);
  EXPECT_EQ(first.command->param2, 191);
  EXPECT_EQ(first.command->param3, -1);
  EXPECT_FALSE(camera.tick(1100 * kMs).command);
  EXPECT_TRUE(camera.tick(1600 * kMs).command);  // nobody answered
  CommandAck ack;
  ack.command = mav_command::kGimbalManagerConfigure;
  ack.result = mav_result::kDenied;
  camera.receive(ack);
  EXPECT_FALSE(camera.ready());
  ack.result = mav_result::kAccepted;
  camera.receive(ack);
  EXPECT_TRUE(camera.ready());
  const auto then = camera.tick(1700 * kMs);
  ASSERT_TRUE(then.set);
  EXPECT_EQ(then.set->yaw_rate, 0.5F);
  EXPECT_EQ(then.set->pitch_rate, -0.25F);
  EXPECT_TRUE(std::isnan(then.set->pitch));
  EXPECT_EQ(then.set->flags, kGimbalYawInVehicleFrame);
}

TEST(GimbalCamera, TakesControlAgainWhenAnotherHasIt) {
  const VehicleHistory history;
  GimbalCamera camera = controlled(history);
  GimbalManagerStatus status;
  status.primary_control_sysid = 255;  // a ground station
  status.primary_control_compid = 190;
  camera.receive(status);
  camera.point({Kind::kAbsolute, 0.1, 0.2});
  const auto out = camera.tick(3000 * kMs);
  EXPECT_TRUE(out.command);
  EXPECT_FALSE(out.set);
}

// Whatever the vehicle's attitude and the frame the gimbal tells its yaw in: the chain with these angles
// turns the camera to where the gimbal truly looks.
TEST(GimbalCamera, IsTheSameDirectionInEveryFrameOfItsYaw) {
  TestRng rng;
  FrameChain chain;
  chain.pan_tilt.emplace();
  // The base's right, down and forward in the body's axes.
  const Eigen::Quaterniond body_from_base = rotation_from_ypr({M_PI / 2, 0, M_PI / 2});
  EXPECT_LT((body_from_base * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 1e-12);
  EXPECT_LT((body_from_base * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  for (int i = 0; i < 100; ++i) {
    const double heading = rng.uniform(-3, 3), yaw = rng.uniform(-1, 1), pitch = rng.uniform(-1.4, 0.3);
    const Eigen::Quaterniond ned_from_body =
        rotation_from_ypr({heading, rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)});
    const Eigen::Vector3d forward = ned_from_body * Eigen::Vector3d::UnitX();
    const double course = std::atan2(forward.y(), forward.x());
    const Eigen::Quaterniond ned_from_gimbal_truth = rotation_from_ypr({course + yaw, pitch, 0});
    for (const uint16_t flags : {uint16_t{32}, uint16_t{64}}) {
      VehicleHistory history;
      const Eigen::Quaterniond told =
          flags == 64 ? ned_from_gimbal_truth : rotation_from_ypr({yaw, pitch, 0});
      for (const int64_t t : {1000 * kMs, 1020 * kMs}) {
        tell_attitude(history, t, ned_from_body);
        tell_gimbal(history, t, told, flags);
      }
      const GimbalCamera camera = controlled(history);
      const auto angles = camera.at(1010 * kMs);
      ASSERT_TRUE(angles);
      const Eigen::Quaterniond ned_from_camera =
          ned_from_body * body_from_base * base_from_camera(chain, angles).rotation;
      const Eigen::Quaterniond expected = ned_from_gimbal_truth * body_from_base;
      EXPECT_LT(ned_from_camera.angularDistance(expected), 1e-5);  // floats on the wire
    }
  }
}

TEST(GimbalCamera, DoesNotGuess) {
  VehicleHistory history;
  const GimbalCamera camera = controlled(history);
  EXPECT_FALSE(camera.at(1000 * kMs));
  for (int64_t t = 1000; t <= 1400; t += 20) tell_attitude(history, t * kMs, Eigen::Quaterniond::Identity());
  tell_gimbal(history, 1000 * kMs, Eigen::Quaterniond::Identity(), 32);
  EXPECT_TRUE(camera.at(1050 * kMs));
  EXPECT_FALSE(camera.at(1100 * kMs));  // long after the last status
  tell_gimbal(history, 1300 * kMs, Eigen::Quaterniond::Identity(), 32);
  EXPECT_FALSE(camera.at(1100 * kMs));  // between two far apart
  tell_gimbal(history, 1320 * kMs, Eigen::Quaterniond::Identity(), 64);
  EXPECT_FALSE(camera.at(1310 * kMs));  // its yaw against another frame now
}

}  // namespace
}  // namespace perch::mavlink
