#include "perch/simulation/live_simulation.h"

#include <gmock/gmock.h>

#include "camera/fake_clock.h"
#include "perch/geometry/so3.h"
#include "support/near_pose.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using std::chrono::milliseconds;

constexpr int64_t kMs = 1'000'000;
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// 21 frames of 80x60 at 20 Hz, each 6 ms exposed and read out in 4 ms.
Simulation small(const std::string& more = "") {
  static const TempFolder folder;
  folder.write("sharp.yaml",
               "name: sharp\nsize: 1.0\nmodules: 20\nborder: 3\nsquares:\n  A: [10, 10, 5]\n  B: [5, 13, 2]\n"
               "  C: [5, 9, 2]\n  D: [5, 5, 2]\n  E: [9, 5, 2]\n  F: [13, 5, 2]\n");
  return read_simulation(Section::parse(
      "target: sharp.yaml\ncamera: {width: 80, height: 60, rate_hz: 20, lens: LENSMODEL_PINHOLE, intrinsics: "
      "[55, 55, 39.5, 29.5], exposure: 0.006, readout: 0.004}\nflight: {duration: 0.8, hover: 0.2}\n" +
          more,
      folder / "simulation.yaml"));
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
}

TEST(LiveSimulation, InRealTimeEachPictureComesWhenItIsReadOut) {
  FakeClock clock;
  const int64_t start = clock.now_ns();
  LiveSimulation live(small(), Pace::kRealTime, clock);
  EXPECT_FALSE(live.recorded());
  EXPECT_FALSE(live.next(milliseconds(4)));
  for (int64_t i = 0; i < 21; ++i) {
    EXPECT_FALSE(live.ended());
    const LiveFrame picture = live.next(milliseconds(60)).value();
    EXPECT_EQ(picture.frame.timestamp_ns, start + i * 50 * kMs);
    EXPECT_EQ(picture.arrived_ns, start + i * 50 * kMs + 5 * kMs);
    EXPECT_TRUE(same(picture.frame.grey, live.flight().picture(i)));
  }
  EXPECT_TRUE(live.ended());
  EXPECT_FALSE(live.next(milliseconds(60)));
  EXPECT_EQ(live.counters().frames, 21);
  EXPECT_EQ(live.counters().dropped, 0);
}

TEST(LiveSimulation, AsFastAsPossibleItIsTheRecordedFlight) {
  FakeClock clock;
  const int64_t start = clock.now_ns();
  LiveSimulation live(small(), Pace::kFast, clock);
  const SimulatedFlight flight(small());
  EXPECT_TRUE(live.recorded());
  for (int64_t i = 0; i < flight.frames(); ++i) {
    clock.pass(100 * kMs);  // whoever asks is slow
    const LiveFrame picture = live.next(milliseconds(0)).value();
    EXPECT_EQ(picture.frame.timestamp_ns, flight.timestamp_ns(i));
    EXPECT_TRUE(same(picture.frame.grey, flight.picture(i)));
  }
  EXPECT_TRUE(live.ended());
  EXPECT_EQ(clock.now_ns() - start, flight.frames() * 100 * kMs);
}

TEST(LiveSimulation, WhoIsSlowGetsPicturesOfNow) {
  FakeClock clock;
  LiveSimulation live(small(), Pace::kRealTime, clock);
  int64_t given = 0;
  while (!live.ended()) {
    if (const auto picture = live.next(milliseconds(20))) {
      EXPECT_EQ(picture->arrived_ns - picture->frame.timestamp_ns, 5 * kMs);
      ++given;
      clock.pass(120 * kMs);
    }
  }
  EXPECT_EQ(given, 7);  // of 21, every third
  EXPECT_EQ(live.counters().dropped, 14);
}

TEST(LiveSimulation, TheVehicleIsWhereThePictureShowsIt) {
  FakeClock clock;
  const LiveSimulation live(small("deck: {}\n"), Pace::kRealTime, clock);
  for (int64_t i = 0; i < 21; i += 5) {
    const Rigid3 body_from_target =
        inverse(live.vehicle(live.stamp_ns(i)).world_from_body) * live.pad(live.stamp_ns(i)).world_from_pad;
    // Rounding of numbers up to 20 m, and of a stamp of 1 s to a double: 1e-16 s.
    EXPECT_THAT(live.flight().simulation().body_from_camera * live.flight().camera_from_target(i),
                IsNearPose(body_from_target, 1e-12, 1e-12));
  }
}

TEST(LiveSimulation, AngularVelocityTurnsTheAttitude) {
  FakeClock clock;
  const LiveSimulation live(small(), Pace::kRealTime, clock);
  const int64_t t = live.stamp_ns(0) + 333 * kMs;
  Eigen::Quaterniond rotation = live.vehicle(t).world_from_body.rotation;
  for (int64_t i = 0; i < 50; ++i) {
    const Eigen::Vector3d turn = live.angular_velocity_in_body(t + i * 2 * kMs + kMs) * 2e-3;
    rotation = (rotation * so3_exp(turn)).normalized();
  }
  // The middle rate of each step is the very difference: rounding alone, 50 times.
  EXPECT_LE(rotation.angularDistance(live.vehicle(t + 100 * kMs).world_from_body.rotation),
            50 * 100 * kEpsilon);
  EXPECT_GT(live.angular_velocity_in_body(t).norm(), 1e-3);
}

TEST(LiveSimulation, NavigationSaysWhatTheRecordedFlightHas) {
  FakeClock clock;
  const LiveSimulation live(small("nav: {time_offset: 0.25}\n"), Pace::kFast, clock);
  for (const NavigationReport& recorded : live.flight().navigation()) {
    const NavigationReport said = live.navigation(recorded.timestamp_ns + 250 * kMs);
    EXPECT_EQ(said.timestamp_ns, recorded.timestamp_ns);
    // A time of 1 ns at 5 m/s.
    EXPECT_THAT(said.world_from_body, IsNearPose(recorded.world_from_body, 1e-8, 1e-8));
    EXPECT_LE((said.body_velocity_in_world - recorded.body_velocity_in_world).norm(), 1e-7);
  }
  // Between two reports the errors stay and the vehicle goes on; long before and after there is an answer,
  // too.
  const int64_t t = live.stamp_ns(0) + 500 * kMs;
  const Eigen::Vector3d moved = live.navigation(t + 15 * kMs).world_from_body.translation -
                                live.navigation(t + 5 * kMs).world_from_body.translation;
  const Eigen::Vector3d truly = live.vehicle(t + 15 * kMs).world_from_body.translation -
                                live.vehicle(t + 5 * kMs).world_from_body.translation;
  EXPECT_LE((moved - truly).norm(), 1e-12);
  for (const int64_t far : {t - 100'000 * kMs, t + 100'000 * kMs}) {
    EXPECT_LE(
        (live.navigation(far).world_from_body.translation - live.vehicle(far).world_from_body.translation)
            .norm(),
        0.2);  // 2 cm noise, ten sigmas
  }
}

TEST(LiveSimulation, OpensTheExample) {
  const auto live =
      open_live_simulation(std::filesystem::path(PERCH_SOURCE_DIR) / "configs/simulation/landing.yaml");
  const auto picture = live->next(std::chrono::seconds(2));
  ASSERT_TRUE(picture);
  EXPECT_EQ(picture->frame.grey.size(), cv::Size(640, 480));
  EXPECT_THROW(open_live_simulation("/nowhere.yaml"), std::runtime_error);
}

}  // namespace
}  // namespace perch
