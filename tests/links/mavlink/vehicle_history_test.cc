#include "perch/links/mavlink/vehicle_history.h"

#include <gtest/gtest.h>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch::mavlink {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr int64_t kMs = 1'000'000;
// A float's unit quaternion.
constexpr double kFloatAngle = 4e-7;

AttitudeQuaternion attitude_message(const Quaterniond& q, const Vector3d& rate) {
  const Eigen::Quaternionf f = q.cast<float>();
  const Eigen::Vector3f w = rate.cast<float>();
  return {0, f.w(), f.x(), f.y(), f.z(), w.x(), w.y(), w.z(), {}};
}

LocalPositionNed position_message(const Vector3d& p, const Vector3d& v) {
  const Eigen::Vector3f a = p.cast<float>(), b = v.cast<float>();
  return {0, a.x(), a.y(), a.z(), b.x(), b.y(), b.z()};
}

Odometry odometry_message(const Quaterniond& q, const Vector3d& p, const Vector3d& v, uint8_t child) {
  Odometry m;
  const Eigen::Quaternionf f = q.cast<float>();
  m.q = {f.w(), f.x(), f.y(), f.z()};
  m.x = static_cast<float>(p.x()), m.y = static_cast<float>(p.y()), m.z = static_cast<float>(p.z());
  m.vx = static_cast<float>(v.x()), m.vy = static_cast<float>(v.y()), m.vz = static_cast<float>(v.z());
  m.frame_id = 1;
  m.child_frame_id = child;
  return m;
}

TEST(History, KeepsTheLastAndFindsThoseAround) {
  struct Sample {
    int64_t time_ns = 0;
  };
  History<Sample> history(10);
  EXPECT_FALSE(history.around(5));
  EXPECT_EQ(history.latest(), nullptr);
  for (int64_t t = 10; t <= 250; t += 10) EXPECT_TRUE(history.add({t}));
  EXPECT_FALSE(history.add({250}));
  EXPECT_FALSE(history.add({240}));
  EXPECT_EQ(history.size(), 10u);
  EXPECT_FALSE(history.around(159));
  for (int64_t t = 160; t < 250; ++t) {
    const auto around = history.around(t);
    ASSERT_TRUE(around && around->second);
    EXPECT_EQ(around->first->time_ns, t / 10 * 10);
    EXPECT_EQ(around->second->time_ns, t / 10 * 10 + 10);
  }
  EXPECT_EQ(history.around(251)->second, nullptr);
  EXPECT_EQ(history.around(250)->first->time_ns, 250);
}

TEST(VehicleHistory, AConstantTurnIsExactBetweenSamplesAndAhead) {
  TestRng rng;
  const Quaterniond start = rng.rotation();
  const Vector3d rate = rng.normal3(1);
  const auto truth = [&](int64_t t) { return start * so3_exp(rate * (static_cast<double>(t) * 1e-9)); };
  VehicleHistory history;
  for (int64_t t = 0; t <= 1000 * kMs; t += 20 * kMs)
    EXPECT_TRUE(history.add(attitude_message(truth(t), rate), t + 1));
  for (int64_t t = 0; t < 1090 * kMs; t += 7 * kMs) {
    const auto sample = history.attitude_at(t + 1);
    ASSERT_TRUE(sample) << t;
    EXPECT_LT(sample->ned_from_body.angularDistance(truth(t)), 2 * kFloatAngle) << t;
  }
  EXPECT_FALSE(history.attitude_at(0));
  EXPECT_FALSE(history.attitude_at(1101 * kMs + 2));
}

TEST(VehicleHistory, DoesNotGuessAcrossAGap) {
  VehicleHistory history;
  history.add(attitude_message(Quaterniond::Identity(), Vector3d::Zero()), 1 * kMs);
  history.add(attitude_message(Quaterniond::Identity(), Vector3d::Zero()), 301 * kMs);
  EXPECT_FALSE(history.attitude_at(150 * kMs));
  EXPECT_TRUE(history.attitude_at(301 * kMs));
  history.add(position_message({0, 0, 0}, {0, 0, 0}), 1 * kMs);
  history.add(position_message({0, 0, 0}, {0, 0, 0}), 601 * kMs);
  EXPECT_FALSE(history.motion_at(300 * kMs));
}

TEST(VehicleHistory, TheAnglesOfAttitudeMeanWhatItsQuaternionMeans) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const Quaterniond q = rng.rotation();
    const YawPitchRoll e = ypr_from_rotation(q);
    VehicleHistory history;
    Attitude m;
    m.roll = static_cast<float>(e.roll), m.pitch = static_cast<float>(e.pitch),
    m.yaw = static_cast<float>(e.yaw);
    EXPECT_TRUE(history.add(m, 5));
    EXPECT_LT(history.attitude_at(5)->ned_from_body.angularDistance(q), 2e-6);
  }
}

TEST(VehicleHistory, TheBetterSourceIsHeardUntilItFallsSilent) {
  VehicleHistory history;
  const auto turned = Quaterniond(Eigen::AngleAxisd(0.5, Vector3d::UnitX()));
  Attitude level;
  EXPECT_TRUE(history.add(level, 10 * kMs));
  EXPECT_TRUE(history.add(attitude_message(turned, Vector3d::Zero()), 20 * kMs));
  EXPECT_FALSE(history.add(level, 30 * kMs));
  EXPECT_FALSE(history.add(odometry_message(Quaterniond::Identity(), {1, 2, 3}, {0, 0, 0}, 99), 30 * kMs));
  EXPECT_NEAR(history.attitude_at(40 * kMs)->ned_from_body.angularDistance(turned), 0, kFloatAngle);
  EXPECT_TRUE(history.add(level, 600 * kMs));
  EXPECT_TRUE(history.add(odometry_message(turned, {1, 2, 3}, {0, 0, 0}, 1), 600 * kMs));
  EXPECT_FALSE(history.add(position_message({0, 0, 0}, {0, 0, 0}), 700 * kMs));
  EXPECT_EQ(history.motion_at(600 * kMs)->body_in_ned, Vector3d(1, 2, 3));
}

TEST(VehicleHistory, VelocityOfOdometryIsTakenFromTheAxesItIsIn) {
  TestRng rng;
  const Quaterniond q = rng.rotation();
  const Vector3d v = rng.normal3(3);
  VehicleHistory body, ned;
  body.add(odometry_message(q, {0, 0, 0}, q.conjugate() * v, 12), 5);
  ned.add(odometry_message(q, {0, 0, 0}, v, 1), 5);
  EXPECT_LT((body.motion_at(5)->body_velocity_in_ned - v).norm(), 5e-6);
  EXPECT_LT((ned.motion_at(5)->body_velocity_in_ned - v).norm(), 5e-6);
  Odometry other = odometry_message(q, {0, 0, 0}, v, 1);
  other.frame_id = 20;  // LOCAL_FRD: its x is not north
  EXPECT_FALSE(ned.add(other, 10));
}

TEST(VehicleHistory, ACubicFlightIsExactBetweenSamples) {
  const auto position = [](double t) { return Vector3d(1 + t - t * t * t, 2 * t * t, -5 + t * t * t); };
  const auto velocity = [](double t) { return Vector3d(1 - 3 * t * t, 4 * t, 3 * t * t); };
  VehicleHistory history;
  for (int i = 0; i <= 10; ++i)
    history.add(position_message(position(0.1 * i), velocity(0.1 * i)), 1 + i * 100 * kMs);
  for (int64_t t = 0; t < 1000 * kMs; t += 13 * kMs) {
    const double s = static_cast<double>(t) * 1e-9;
    EXPECT_LT((history.motion_at(t + 1)->body_in_ned - position(s)).norm(), 3e-6);
  }
  // Ahead by the last velocity.
  EXPECT_LT((history.motion_at(1100 * kMs + 1)->body_in_ned - (position(1) + 0.1 * velocity(1))).norm(),
            3e-6);
}

TEST(VehicleHistory, AResetPartsTheMapsWhetherItIsToldOrShown) {
  for (const bool told : {true, false}) {
    VehicleHistory history;
    for (int i = 0; i < 20; ++i) {
      const Vector3d p(i < 10 ? 0 : told ? 0.1 : 2.0, 0, -5);
      if (told) {
        Odometry m = odometry_message(Quaterniond::Identity(), p, {0, 0, 0}, 1);
        m.reset_counter = i < 10 ? 255 : 0;
        history.add(m, 1 + i * 30 * kMs);
      } else {
        history.add(position_message(p, {0, 0, 0}), 1 + i * 30 * kMs);
      }
    }
    EXPECT_FALSE(history.motion_at(285 * kMs));
    EXPECT_NE(history.motion_at(100 * kMs)->resets, history.motion_at(400 * kMs)->resets);
    EXPECT_EQ(history.motion_at(1)->resets, history.motion_at(269 * kMs)->resets);
  }
}

TEST(VehicleHistory, HardFlightIsNoReset) {
  VehicleHistory history;
  for (int i = 0; i < 100; ++i) {  // 10 m/s^2, at 5 Hz only
    const double t = 0.2 * i;
    history.add(
        position_message({10 * std::sin(t), 10 * std::cos(t), 0}, {10 * std::cos(t), -10 * std::sin(t), 0}),
        1 + i * 200 * kMs);
  }
  EXPECT_EQ(history.motions()[0].resets, history.motions().latest()->resets);
}

TEST(VehicleHistory, RangesLookDown) {
  VehicleHistory history;
  DistanceSensor m;
  m.current_distance = 250, m.min_distance = 20, m.max_distance = 1200;
  m.orientation = 0;
  EXPECT_FALSE(history.add(m, 5));
  m.orientation = 25;
  EXPECT_TRUE(history.add(m, 5));
  EXPECT_DOUBLE_EQ(history.ranges().latest()->distance, 2.5);
}

TEST(Gimbal, YawIsAgainstNorthOrHeadingAsItsFlagsSay) {
  // Heading east, banked; the camera looks 30 degrees to the right of the nose, and 90 degrees down.
  const Quaterniond ned_from_body = Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ())) *
                                    Quaterniond(Eigen::AngleAxisd(0.4, Vector3d::UnitX()));
  const Quaterniond camera = Quaterniond(Eigen::AngleAxisd(M_PI / 6, Vector3d::UnitZ())) *
                             Quaterniond(Eigen::AngleAxisd(-M_PI / 2, Vector3d::UnitY()));
  const Quaterniond turned = Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ())) * camera;
  for (const auto& [flags, earth] :
       {std::pair{64, true}, {32, false}, {32 | 16, false}, {16, true}, {0, false}}) {
    const GimbalSample sample{0, 154, static_cast<uint16_t>(flags), camera};
    EXPECT_LT(ned_from_gimbal(sample, ned_from_body).angularDistance(earth ? camera : turned), 1e-7) << flags;
  }
  // Straight down, whatever the vehicle's bank.
  EXPECT_LT((turned * Vector3d::UnitX() - Vector3d::UnitZ()).norm(), 1e-12);
}

}  // namespace
}  // namespace perch::mavlink
