#include "perch/flight/flight_recorder.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <algorithm>
#include <set>
#include <thread>

#include "flight/recording.h"
#include "support/near_pose.h"

namespace perch {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(Recording, IsAFlightThatReadsBackAlike) {
  auto r = recorder();
  std::vector<Frame> frames;
  for (int i = 0; i < 20; ++i) {
    frames.push_back(frame(i));
    ASSERT_TRUE(r->add_frame(frames[static_cast<size_t>(i)], aid(i), estimate(i)));
  }
  const NavSample nav{kStartNs, {Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1.0 / 3, 2, 3}}, {4, 5, 0.1}};
  r->add_navigation(nav);
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  r->add_navigation(
      {kStartNs + 1, {Eigen::Quaterniond(unknown, unknown, unknown, unknown), {7, 8, 9}}, {4, 5, 6}});
  r->add_event(5, "locked on,\nsaid twice");
  const std::vector<uint8_t> heartbeat{0xFD, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0x12, 0x34};
  r->add_bytes(FlightRecorder::Direction::kOut, 1'000'000, heartbeat);
  r->close();
  EXPECT_FALSE(add(*r, 20));
  EXPECT_EQ(r->counters().frames_written, 20);
  EXPECT_EQ(r->counters().frames_dropped, 0);
  EXPECT_EQ(r->counters().last_problem, "");

  const Recorded recorded(r->folder());
  ASSERT_EQ(recorded.problems.size(), 1u);
  EXPECT_THAT(recorded.problems[0], HasSubstr("nav0/data.csv: 1 rows without an attitude"));
  ASSERT_EQ(recorded.frames.size(), 20u);
  ASSERT_EQ(recorded.aids.size(), 20u);
  EXPECT_EQ(recorded.states.size(), 20u);
  std::string estimates = estimates_header(), aids = aids_header();
  for (int i = 0; i < 20; ++i) {
    const Frame& a = frames[static_cast<size_t>(i)];
    const Frame& b = recorded.frames[static_cast<size_t>(i)];
    EXPECT_EQ(a.timestamp_ns, b.timestamp_ns);
    EXPECT_EQ(cv::norm(a.grey, b.grey, cv::NORM_L1), 0);
    append_estimate(estimate(i), estimates);
    append_aid(a.timestamp_ns, aid(i), aids);
  }
  EXPECT_EQ(read_file(r->folder() / "run/estimates.csv"), estimates);
  EXPECT_EQ(read_file(r->folder() / "run/aids.csv"), aids);
  EXPECT_EQ(read_file(r->folder() / "run/config.yaml"), "target: pad.yaml\n");
  const std::string events = read_file(r->folder() / "run/events.csv");
  EXPECT_THAT(events, HasSubstr("\n5,locked on, said twice\n"));
  EXPECT_THAT(events, HasSubstr(",recording ended: 20 pictures written and 0 dropped; 0 rows and 0 bytes"));
  const std::string tlog = read_file(r->folder() / "run/mavlink.tlog");
  EXPECT_EQ(tlog.substr(8), std::string(heartbeat.begin(), heartbeat.end()));

  const Flight& flight = recorded.flight;
  EXPECT_EQ(flight.camera->lens(), camera.lens());
  EXPECT_EQ(flight.camera->intrinsics(), camera.intrinsics());
  EXPECT_THAT(*flight.body_from_camera, IsNearPose(*mount, 1e-15, 0));
  ASSERT_EQ(flight.nav.samples.size(), 2u);
  EXPECT_TRUE(flight.nav.samples[0].knows_attitude());
  EXPECT_FALSE(flight.nav.samples[1].knows_attitude());
  EXPECT_EQ(flight.nav.samples[1].world_from_body.translation, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(flight.nav.samples[0].world_from_body.translation, nav.world_from_body.translation);
  EXPECT_EQ(flight.nav.samples[0].body_velocity_in_world, nav.body_velocity_in_world);
  ASSERT_EQ(flight.gimbal.size(), 20u);
  EXPECT_EQ(flight.gimbal[7].tilt, aid(7).angles->tilt);
  EXPECT_EQ(flight.gimbal[7].zoom, aid(7).zoom);
  EXPECT_EQ(flight.gimbal[8].zoom, std::nullopt);
}

TEST_F(Recording, WithoutMountOrNavigationHasNone) {
  mount.reset();
  auto r = recorder();
  ASSERT_TRUE(r->add_frame(frame(0), {}, estimate(0)));
  r->close();
  const Recorded recorded(r->folder());
  EXPECT_THAT(recorded.problems, IsEmpty());
  EXPECT_FALSE(recorded.flight.body_from_camera);
  EXPECT_THAT(recorded.flight.nav.samples, IsEmpty());
  EXPECT_THAT(recorded.flight.gimbal, IsEmpty());
}

TEST_F(Recording, AsAVideoReadsBackAlike) {
  options.format = "ffv1";
  auto r = recorder();
  std::vector<Frame> frames;
  for (int i = 0; i < 20; ++i) {
    frames.push_back(frame(i));
    ASSERT_TRUE(r->add_frame(frames.back(), aid(i), estimate(i)));
  }
  Frame broken = frame(20);
  broken.grey.release();
  r->add_frame(broken, aid(20), estimate(20));
  r->close();
  EXPECT_EQ(r->counters().frames_written, 20);
  EXPECT_EQ(r->counters().last_problem, "a picture that the video cannot hold");
  const Recorded recorded(r->folder());
  EXPECT_THAT(recorded.problems, IsEmpty());
  ASSERT_EQ(recorded.frames.size(), 20u);
  for (size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(recorded.frames[i].timestamp_ns, frames[i].timestamp_ns);
    EXPECT_EQ(cv::norm(recorded.frames[i].grey, frames[i].grey, cv::NORM_L1), 0);
  }
}

TEST_F(Recording, OfAVideoOnAFullDiskKeepsFramesAndRowsTogether) {
  options.format = "ffv1";
  auto r = recorder();
  std::vector<Frame> frames;
  for (int i = 0; i < 30; ++i) {
    frames.push_back(frame(i));
    // Refuses now and then, at whatever the thread writes just then.
    disk_->full = i % 3 == 1;
    r->add_frame(frames.back(), aid(i), estimate(i));
    std::this_thread::sleep_for(std::chrono::microseconds(rng.bits() % 1000));
  }
  // And for as long as it takes, once.
  disk_->full = true;
  frames.push_back(frame(30));
  r->add_frame(frames.back(), aid(30), estimate(30));
  wait_until([&] { return r->counters().frames_dropped > 0; });
  disk_->full = false;
  frames.push_back(frame(31));
  r->add_frame(frames.back(), aid(31), estimate(31));
  r->close();
  EXPECT_GT(r->counters().frames_dropped, 0);
  const Recorded recorded(r->folder());
  EXPECT_THAT(recorded.problems, IsEmpty());
  EXPECT_EQ(recorded.frames.size(), static_cast<size_t>(r->counters().frames_written));
  for (const Frame& f : recorded.frames) {
    const auto i = static_cast<size_t>((f.timestamp_ns - kStartNs) / kPeriodNs);
    EXPECT_EQ(cv::norm(f.grey, frames[i].grey, cv::NORM_L1), 0) << i;
  }
}

TEST_F(Recording, ThatCannotBeginSaysWhy) {
  options.folder = folder_.write("file", "");
  EXPECT_THROW(recorder(), std::runtime_error);
  options.folder = folder_ / "flights";
  disk_->full = true;
  EXPECT_THROW(recorder(), std::runtime_error);
  disk_->full = false;
  options.format = "gif";
  EXPECT_THROW(recorder(), std::invalid_argument);
  options.format = "ffv1";
  options.queue_frames = 0;
  EXPECT_THROW(recorder(), std::invalid_argument);
}

TEST_F(Recording, TwoOfOneSecondHaveFoldersOfTheirOwn) {
  std::set<fs::path> folders;
  for (int i = 0; i < 3; ++i) folders.insert(recorder()->folder());
  EXPECT_EQ(folders.size(), 3u);
}

TEST_F(Recording, AFrameThatCouldNotBeReadIsThatInAReplay) {
  auto r = recorder();
  Frame broken;
  broken.timestamp_ns = kStartNs;
  broken.problem = "camera: torn";
  ASSERT_TRUE(r->add_frame(broken, aid(0), estimate(0)));
  ASSERT_TRUE(add(*r, 1));
  r->close();
  const Recorded recorded(r->folder());
  ASSERT_EQ(recorded.frames.size(), 2u);
  EXPECT_THAT(recorded.frames[0].problem, EndsWith(".png: no such file"));
  EXPECT_EQ(recorded.frames[1].problem, "");
}

TEST_F(Recording, AClockThatGoesBackCostsThatPicture) {
  auto r = recorder();
  EXPECT_TRUE(add(*r, 5));
  EXPECT_FALSE(add(*r, 5));
  EXPECT_FALSE(add(*r, 4));
  EXPECT_TRUE(add(*r, 6));
  r->close();
  EXPECT_EQ(r->counters().frames_dropped, 2);
  EXPECT_THAT(r->counters().last_problem, HasSubstr("not later than the one before it"));
  const Recorded recorded(r->folder());
  EXPECT_THAT(recorded.problems, IsEmpty());
  EXPECT_EQ(recorded.frames.size(), 2u);
  EXPECT_EQ(recorded.estimates.size(), 4u);
}

// How often this thread went to sleep since it began: for a lock, a disk or a condition.
long sleeps() {
  rusage used{};
  getrusage(RUSAGE_THREAD, &used);
  return used.ru_nvcsw;
}

TEST_F(Recording, AStalledDiskCostsPicturesAndDelaysNobody) {
  constexpr int kFrames = 300;
  options.queue_frames = 10;
  auto r = recorder();
  const Frame one = frame(0);
  std::vector<bool> kept;
  const auto add_one = [&](int i) {
    Frame f = one;
    f.timestamp_ns = kStartNs + i * kPeriodNs;
    kept.push_back(r->add_frame(f, aid(i), estimate(i)));
    r->add_bytes(FlightRecorder::Direction::kIn, i, std::vector<uint8_t>(50, 0));
  };
  for (int i = 0; i < kFrames; ++i) add_one(i);
  disk_->stall();
  r->add_event(0, "something to write");
  disk_->wait_for_a_stalled_one();
  const auto early = std::count(kept.begin(), kept.end(), true);
  // The disk stands still until all calls are over: one that waited for it would never end. Nor do they wait
  // for anything else, but for a lock at which they happen to meet a thread on its way to the disk.
  const long slept = sleeps();
  for (int i = kFrames; i < 2 * kFrames; ++i) add_one(i);
  EXPECT_LE(sleeps() - slept, 5);
  EXPECT_LE(std::count(kept.begin(), kept.end(), true) - early, 10);
  disk_->resume();
  r->close();

  const auto counters = r->counters();
  EXPECT_EQ(counters.frames_written, std::count(kept.begin(), kept.end(), true));
  EXPECT_EQ(counters.frames_written + counters.frames_dropped, 2 * kFrames);
  EXPECT_EQ(counters.rows_dropped, 0);
  EXPECT_THAT(counters.last_problem, HasSubstr("does not keep up"));
  const Recorded recorded(r->folder());
  EXPECT_THAT(recorded.problems, IsEmpty());
  EXPECT_EQ(recorded.frames.size(), static_cast<size_t>(counters.frames_written));
  // The estimates of all frames, also of those without a picture.
  EXPECT_EQ(recorded.estimates.size(), 2u * kFrames);
  EXPECT_EQ(recorded.aids.size(), 2u * kFrames);
}

TEST_F(Recording, KeepsTheLogAndIsBroughtToTheDiskWhileItGoesOn) {
  auto r = recorder();
  r->add_log("I live_run.cc:1] first");
  r->add_log("I live_run.cc:2] second");
  wait_until([&] { return disk_->synced >= 1; });
  EXPECT_GE(disk_->synced, 1);
  r->close();
  EXPECT_EQ(read_file(r->folder() / "run/log"), "I live_run.cc:1] first\nI live_run.cc:2] second\n");
}

TEST_F(Recording, TakesNoMoreMemoryThanItsQueues) {
  auto r = recorder();
  disk_->stall();
  add(*r, 0);
  disk_->wait_for_a_stalled_one();
  const std::vector<uint8_t> bytes(100'000, 0xFD);
  for (int i = 0; i < 1000; ++i) r->add_bytes(FlightRecorder::Direction::kIn, i, bytes);
  const auto counters = r->counters();
  // 100 MB came and a little more than 16 MB, or twice that, may wait.
  EXPECT_GT(counters.bytes_dropped, 60'000'000);
  EXPECT_LT(counters.bytes_dropped, 90'000'000);
  disk_->resume();
}

TEST_F(Recording, AFullDiskCostsPicturesUntilThereIsRoom) {
  auto r = recorder();
  ASSERT_TRUE(add(*r, 0));
  wait_until([&] { return r->counters().frames_written == 1; });
  disk_->full = true;
  for (int i = 1; i < 6; ++i) add(*r, i);
  wait_until([&] { return r->counters().frames_dropped == 5; });
  // The tables are tried, refused, and kept.
  const int refused = disk_->refused;
  wait_until([&] { return disk_->refused > refused; });
  EXPECT_THAT(r->counters().last_problem, HasSubstr("No space left on device"));
  disk_->full = false;
  ASSERT_TRUE(add(*r, 6));
  r->close();
  EXPECT_EQ(r->counters().frames_written, 2);
  EXPECT_EQ(r->counters().frames_dropped, 5);
  const Recorded recorded(r->folder());
  EXPECT_THAT(recorded.problems, IsEmpty());
  EXPECT_EQ(recorded.frames.size(), 2u);
  EXPECT_EQ(recorded.estimates.size(), 7u);
  EXPECT_EQ(recorded.aids.size(), 7u);
  EXPECT_EQ(std::distance(fs::directory_iterator(r->folder() / "mav0/cam0/data"), {}), 2);
  EXPECT_THAT(read_file(r->folder() / "run/events.csv"), HasSubstr(",recorder: "));
}

TEST_F(Recording, LeavesTheRestOfTheDiskToOthers) {
  options.least_free_disk = 1e6;
  disk_->left = 9e5;
  auto r = recorder();
  add(*r, 0);
  wait_until([&] { return r->counters().frames_dropped == 1; });
  EXPECT_EQ(r->counters().disk_left, 9e5);
  disk_->left = 2e6;
  wait_until([&] { return r->counters().disk_left == 2e6; });
  add(*r, 1);
  r->close();
  const Recorded recorded(r->folder());
  EXPECT_EQ(recorded.frames.size(), 1u);
  EXPECT_EQ(recorded.estimates.size(), 2u);
}

}  // namespace
}  // namespace perch
