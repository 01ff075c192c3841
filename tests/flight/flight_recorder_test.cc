#include "perch/flight/flight_recorder.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <set>
#include <thread>

#include "perch/flight/aids_file.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/flight.h"
#include "support/near_pose.h"
#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int64_t kStartNs = 1'700'000'000'000'000'000, kPeriodNs = 33'333'333;

// The real disk, until a test makes it slow or full.
class TestDisk : public RecordingDisk {
 public:
  std::unique_ptr<RecordingFile> create(const fs::path& file) override {
    pass(file);
    return std::make_unique<File>(*this, file, disk_->create(file));
  }
  double bytes_left(const fs::path&) override { return left; }

  // From now on nobody gets by, until resume().
  void stall() { set_stalled(true); }
  void resume() { set_stalled(false); }
  // Until somebody stands there.
  void wait_for_a_stalled_one() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return waiting_ > 0; });
  }

  std::atomic<bool> full = false;
  std::atomic<double> left = 1e12;
  std::atomic<int> refused = 0;

 private:
  class File : public RecordingFile {
   public:
    File(TestDisk& disk, fs::path path, std::unique_ptr<RecordingFile> file)
        : disk_(disk), path_(std::move(path)), file_(std::move(file)) {}
    void append(std::string_view bytes) override {
      disk_.pass(path_);
      file_->append(bytes);
    }

   private:
    TestDisk& disk_;
    fs::path path_;
    std::unique_ptr<RecordingFile> file_;
  };

  void pass(const fs::path& file) {
    std::unique_lock lock(mutex_);
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [&] { return !stalled_; });
    --waiting_;
    if (!full) return;
    ++refused;
    throw std::runtime_error(file.string() + ": cannot be written: No space left on device");
  }
  void set_stalled(bool stalled) {
    const std::lock_guard lock(mutex_);
    stalled_ = stalled;
    changed_.notify_all();
  }

  std::shared_ptr<RecordingDisk> disk_ = real_disk();
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stalled_ = false;
  int waiting_ = 0;
};

// Waits for what another thread does soon; a test that waits in vain fails by what it checks next.
template <typename Condition>
void wait_until(Condition condition) {
  for (int i = 0; i < 10'000 && !condition(); ++i) std::this_thread::sleep_for(1ms);
}

class Recording : public testing::Test {
 protected:
  Recording() { options.folder = folder_ / "flights", options.disk = disk_; }

  std::unique_ptr<FlightRecorder> recorder() const {
    return std::make_unique<FlightRecorder>(options, camera, "target: pad.yaml\n", mount, 30);
  }
  // The i-th of a run: every number another.
  Frame frame(int i) {
    Frame f;
    f.timestamp_ns = kStartNs + i * kPeriodNs;
    f.grey.create(camera.height(), camera.width(), CV_8UC1);
    for (int y = 0; y < f.grey.rows; ++y) {
      for (int x = 0; x < f.grey.cols; ++x) f.grey.at<uint8_t>(y, x) = static_cast<uint8_t>(rng.bits());
    }
    return f;
  }
  static Estimator::Aid aid(int i) {
    Estimator::Aid a;
    a.angles = HeadAngles{0.1 * i, 1.0 / (i + 3)};
    a.world_from_body = Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5);
    a.autopilot.resize(2);
    a.autopilot[1].timestamp_ns = kStartNs + i;
    return a;
  }
  static Estimate estimate(int i) {
    Estimate e;
    e.timestamp_ns = kStartNs + i * kPeriodNs;
    e.status = EstimateStatus::kOk;
    e.camera_from_target.mean.translation = {1.0 / 3, 0.1 * i, 5};
    e.state.emplace().timestamp_ns = e.timestamp_ns;
    return e;
  }
  bool add(FlightRecorder& r, int i) { return r.add_frame(frame(i), aid(i), estimate(i)); }

  TempFolder folder_;
  std::shared_ptr<TestDisk> disk_ = std::make_shared<TestDisk>();
  RecorderOptions options;
  CameraModel camera{
      "LENSMODEL_OPENCV8", {50.1, 50.2, 31.3, 23.7, 0.1, 0.01, 1e-3, 1.0 / 3, 0.1, 0.2, 0.3, 0.4}, 64, 48};
  std::optional<Rigid3> mount = Rigid3{Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {0.1, 0.2, 0.3}};
  TestRng rng;
};

// All of a flight's folder, as its readers see it.
struct Recorded {
  explicit Recorded(const fs::path& folder) : flight(read_flight(folder)) {
    problems = flight.problems;
    const auto source = open_image_source("flight:" + folder.string());
    for (Frame f; source->next(f);) frames.push_back(f);
    problems.insert(problems.end(), source->problems().begin(), source->problems().end());
    aids = read_aids(folder / "run/aids.csv", problems);
    estimates = read_estimates(folder / "run/estimates.csv", problems, LastLine::kMustEnd);
    states = read_states(folder / "run/states.csv", problems, LastLine::kMustEnd);
    for (const Frame& f : frames) {
      if (!f.problem.empty()) problems.push_back(f.problem);
    }
  }
  Flight flight;
  std::vector<Frame> frames;
  std::vector<FrameAid> aids;
  std::vector<Estimate> estimates;
  std::vector<VehicleState> states;
  std::vector<std::string> problems;
};

TEST_F(Recording, IsAFlightThatReadsBackAlike) {
  auto r = recorder();
  std::vector<Frame> frames;
  for (int i = 0; i < 20; ++i) {
    frames.push_back(frame(i));
    ASSERT_TRUE(r->add_frame(frames[static_cast<size_t>(i)], aid(i), estimate(i)));
  }
  const NavSample nav{kStartNs, {Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1.0 / 3, 2, 3}}, {4, 5, 0.1}};
  r->add_navigation(nav);
  r->add_event(5, "locked on,\nsaid twice");
  const std::vector<uint8_t> heartbeat{0xFD, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0x12, 0x34};
  r->add_bytes(FlightRecorder::Direction::kOut, 1'000'000, heartbeat);
  r->close();
  EXPECT_FALSE(add(*r, 20));
  EXPECT_EQ(r->counters().frames_written, 20);
  EXPECT_EQ(r->counters().frames_dropped, 0);
  EXPECT_EQ(r->counters().last_problem, "");

  const Recorded recorded(r->folder());
  EXPECT_THAT(recorded.problems, IsEmpty());
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
  ASSERT_EQ(flight.nav.samples.size(), 1u);
  EXPECT_EQ(flight.nav.samples[0].world_from_body.translation, nav.world_from_body.translation);
  EXPECT_EQ(flight.nav.samples[0].body_velocity_in_world, nav.body_velocity_in_world);
  ASSERT_EQ(flight.gimbal.size(), 20u);
  EXPECT_EQ(flight.gimbal[7].tilt, aid(7).angles->tilt);
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
  disk_->full = false;
  frames.push_back(frame(30));
  r->add_frame(frames.back(), aid(30), estimate(30));
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

// The times of calls while `count` frames go in, each the same work.
std::vector<double> times_of(int begin, int count, const std::function<void(int)>& add) {
  std::vector<double> us;
  for (int i = begin; i < begin + count; ++i) {
    const auto before = std::chrono::steady_clock::now();
    add(i);
    us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - before).count());
  }
  std::sort(us.begin(), us.end());
  return us;
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
  const auto before = times_of(0, kFrames, add_one);
  disk_->stall();
  r->add_event(0, "something to write");
  disk_->wait_for_a_stalled_one();
  const auto early = std::count(kept.begin(), kept.end(), true);
  // The disk stands still until all calls are over: one that waited for it would never end.
  const auto stalled = times_of(kFrames, kFrames, add_one);
  EXPECT_LE(std::count(kept.begin(), kept.end(), true) - early, 10);
  // The median, of one thread on a machine with others: the same work or less, and a factor for the noise.
  EXPECT_LT(stalled[kFrames / 2], 5 * before[kFrames / 2]);
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

// What a child has told its parent so far.
struct Progress {
  std::atomic<int> frames, pictures;
};

TEST_F(Recording, KilledAtAnyMomentItLosesASecondAtMost) {
  constexpr int kRounds = 5, kAtATime = 4;
  options.disk = real_disk();
  auto* progress = static_cast<Progress*>(
      mmap(nullptr, kAtATime * sizeof(Progress), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  ASSERT_NE(progress, MAP_FAILED);
  for (int round = 0; round < kRounds; ++round) {
    options.format = round % 2 == 0 ? "png" : "ffv1";
    std::vector<pid_t> children;
    std::vector<fs::path> folders;
    for (int c = 0; c < kAtATime; ++c) {
      options.folder = folder_ / ("round" + std::to_string(round) + "_" + std::to_string(c));
      folders.push_back(options.folder);
      progress[c].frames = progress[c].pictures = 0;
      const pid_t child = fork();
      if (child == 0) {
        const auto r = recorder();
        const Frame one = frame(0);
        for (int i = 0;; ++i) {
          Frame f = one;
          f.timestamp_ns += i * kPeriodNs;
          if (r->add_frame(f, aid(i), estimate(i))) ++progress[c].pictures;
          ++progress[c].frames;
          std::this_thread::sleep_for(1ms);
        }
      }
      ASSERT_GT(child, 0);
      children.push_back(child);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(100'000 + rng.bits() % 300'000));
    std::vector<std::pair<int, int>> a_second_ago;
    for (int c = 0; c < kAtATime; ++c) a_second_ago.emplace_back(progress[c].frames, progress[c].pictures);
    std::this_thread::sleep_for(1s);
    for (const pid_t child : children) {
      kill(child, SIGKILL);
      std::this_thread::sleep_for(std::chrono::microseconds(rng.bits() % 10'000));
    }
    for (const pid_t child : children) waitpid(child, nullptr, 0);
    for (size_t c = 0; c < kAtATime; ++c) {
      const Recorded recorded(fs::directory_iterator(folders[c])->path());
      const auto [frames, pictures] = a_second_ago[c];
      EXPECT_GT(pictures, 0);
      EXPECT_GE(recorded.frames.size(), static_cast<size_t>(pictures));
      EXPECT_GE(recorded.aids.size(), static_cast<size_t>(frames));
      EXPECT_GE(recorded.estimates.size(), static_cast<size_t>(frames));
      EXPECT_GE(recorded.states.size(), static_cast<size_t>(frames));
      // A row that was cut off at most, in each of the files; every picture that has a row is whole.
      EXPECT_LE(recorded.problems.size(), 4u) << testing::PrintToString(recorded.problems);
      for (const std::string& problem : recorded.problems) EXPECT_THAT(problem, HasSubstr("cut off"));
    }
  }
  munmap(progress, kAtATime * sizeof(Progress));
}

TEST_F(Recording, CutOffAnywhereItsTablesKeepWhatIsWhole) {
  auto r = recorder();
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(add(*r, i));
    r->add_navigation({kStartNs + i, {}, {1.25, 2.5, 3.125}});
  }
  r->close();
  const fs::path flight = r->folder();
  for (const char* name : {"mav0/cam0/data.csv", "mav0/nav0/data.csv", "mav0/gimbal0/data.csv",
                           "run/estimates.csv", "run/states.csv"}) {
    const std::string whole = read_file(flight / name);
    for (size_t cut = 1; whole[whole.size() - cut - 1] != '\n'; ++cut) {
      std::ofstream(flight / name, std::ios::binary) << whole.substr(0, whole.size() - cut);
      const Recorded recorded(flight);
      ASSERT_EQ(recorded.problems.size(), 1u) << name << " less " << cut;
      EXPECT_THAT(recorded.problems[0],
                  EndsWith(std::string(name) + ":4: the file was cut off within this row, row skipped"));
    }
    std::ofstream(flight / name, std::ios::binary) << whole;
  }
}

}  // namespace
}  // namespace perch
