#include "perch/flight/nav_track.h"

#include <limits>

#include "support/near_pose.h"

namespace perch {
namespace {

constexpr int64_t kMs = 1'000'000;

// x = t^2 (2 m/s^2), turning about z at 1 rad/s, from 1.7e18 ns on.
NavSample accelerating(int64_t time_ns, int64_t start_ns) {
  const double t = static_cast<double>(time_ns - start_ns) * 1e-9;
  return {time_ns,
          {Eigen::Quaterniond(Eigen::AngleAxisd(t, Eigen::Vector3d::UnitZ())), {t * t, 3, 0}},
          {2 * t, 0, 0}};
}

TEST(NavTrack, FollowsAnAcceleratingVehicle) {
  const int64_t start = 1'700'000'000'000'000'000;
  NavTrack track;
  for (int i = 0; i < 5; ++i) track.samples.push_back(accelerating(start + i * 400 * kMs, start));
  for (int64_t time = start; time <= start + 1600 * kMs; time += 7 * kMs) {
    const auto sample = track.at(time);
    ASSERT_TRUE(sample);
    EXPECT_EQ(sample->timestamp_ns, time);
    const NavSample truth = accelerating(time, start);
    // Rounding: slerp and the cubic are exact for this motion.
    EXPECT_THAT(sample->world_from_body, IsNearPose(truth.world_from_body, 1e-12, 1e-12));
    EXPECT_LE((sample->body_velocity_in_world - truth.body_velocity_in_world).norm(), 1e-12);
  }
}

TEST(NavTrack, StraightWhereTheVelocitiesContradictThePositions) {
  NavTrack track;
  for (int i = 0; i < 3; ++i) {
    NavSample sample;
    sample.timestamp_ns = i * 100 * kMs;
    sample.world_from_body.translation.x() = i;
    sample.body_velocity_in_world = {0, 10, 0};  // of another frame: it flies 10 m/s in x
    track.samples.push_back(sample);
  }
  EXPECT_LE((track.at(125 * kMs)->world_from_body.translation - Eigen::Vector3d(1.25, 0, 0)).norm(), 1e-14);
}

TEST(NavTrack, GoesOnWithTheLastVelocityFor50Ms) {
  NavTrack track;
  track.samples.push_back({100 * kMs, {Eigen::Quaterniond::Identity(), {1, 2, 3}}, {10, 0, -20}});
  EXPECT_LE((track.at(150 * kMs)->world_from_body.translation - Eigen::Vector3d(1.5, 2, 2)).norm(), 1e-14);
  EXPECT_LE((track.at(50 * kMs)->world_from_body.translation - Eigen::Vector3d(0.5, 2, 4)).norm(), 1e-14);
  EXPECT_EQ(track.at(100 * kMs)->world_from_body.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(track.at(151 * kMs));
  EXPECT_FALSE(track.at(49 * kMs));
}

TEST(NavTrack, KnowsNothingInALongGap) {
  NavTrack track;
  for (const int64_t ms : {0, 500, 1001}) {
    NavSample sample;
    sample.timestamp_ns = ms * kMs;
    track.samples.push_back(sample);
  }
  EXPECT_TRUE(track.at(250 * kMs));
  EXPECT_FALSE(track.at(501 * kMs));
  EXPECT_FALSE(track.at(1000 * kMs));
  EXPECT_TRUE(track.at(1001 * kMs));
  EXPECT_FALSE(NavTrack{}.at(0));
  EXPECT_FALSE(track.at(std::numeric_limits<int64_t>::max()));
  EXPECT_FALSE(track.at(std::numeric_limits<int64_t>::min()));
}

}  // namespace
}  // namespace perch
