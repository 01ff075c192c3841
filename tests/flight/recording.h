#pragma once

#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "perch/flight/aids_file.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/flight.h"
#include "perch/flight/flight_recorder.h"
#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

inline constexpr int64_t kStartNs = 1'700'000'000'000'000'000, kPeriodNs = 33'333'333;

// The real disk, until a test makes it slow or full.
class TestDisk : public RecordingDisk {
 public:
  std::unique_ptr<RecordingFile> create(const fs::path& file) override {
    pass(file);
    return std::make_unique<File>(*this, file, disk_->create(file));
  }
  double bytes_left(const fs::path&) override { return left; }
  void sync(const fs::path& folder) override {
    pass(folder);
    ++synced;
  }

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
  std::atomic<int> refused = 0, synced = 0;

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
    if (i % 2 == 1) a.zoom = 1.0 / i;
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

}  // namespace perch
