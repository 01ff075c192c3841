// perch-live on a machine that gives it no time, and on a disk that takes no more.

#include <signal.h>

#include "apps/live_rig.h"
#include "perch/flight/flight.h"

namespace perch {
namespace {

using Eigen::Vector3d;

// PX4's estimator is told the place at the exposure, with its sigma: whatever the machine does meanwhile, it
// is right or it is not.
class Stressed : public PerchLive {
 protected:
  Stressed() {
    autopilot_.with([](auto& autopilot) {
      autopilot.autopilot = mavlink::mav_autopilot::kPx4;
      autopilot.parameters = {{"VTE_EN", 1}};
    });
  }
  // Waits until so many have come since.
  bool relative_targets_come(int64_t since_ns, int count) const {
    for (double t = 0; t < kPatience; t += 0.02, sleep(0.02)) {
      int come = 0;
      for (const auto& target : autopilot_.relative_targets()) come += target.arrived_ns >= since_ns;
      if (come >= count) return true;
    }
    return false;
  }
};

// Endless sums, at the same priority as all others.
class Hogs {
 public:
  explicit Hogs(unsigned count) {
    for (unsigned i = 0; i < count; ++i) {
      const pid_t child = fork();
      if (child == 0) {
        for (std::atomic<uint64_t> sum = 0;;) ++sum;
      }
      children_.push_back(child);
    }
  }
  ~Hogs() {
    for (const pid_t child : children_) kill(child, SIGKILL), waitpid(child, nullptr, 0);
  }
  Hogs(const Hogs&) = delete;
  Hogs& operator=(const Hogs&) = delete;

 private:
  std::vector<pid_t> children_;
};

TEST_F(Stressed, StoppedAndStarvedItSaysNothingStaleAndNothingWrong) {
  ChildProgram live = start();
  fly_with(live);
  ASSERT_TRUE(relative_targets_come(0, 5)) << live.err();
  // Not a turn for longer than a measurement may be old: what was on its way then must not go out afterwards.
  for (int i = 0; i < 2; ++i) {
    live.signal(SIGSTOP);
    sleep(0.8);
    live.signal(SIGCONT);
    EXPECT_TRUE(relative_targets_come(monotonic_ns(), 5)) << live.err();
  }
  const int64_t starved_ns = monotonic_ns();
  {
    const Hogs hogs(4 * std::thread::hardware_concurrency());
    sleep(1);
  }
  EXPECT_TRUE(relative_targets_come(monotonic_ns(), 5)) << live.err();
  EXPECT_EQ(live.stop(), 0) << live.err();

  for (const auto& [arrived_ns, target] : autopilot_.relative_targets()) {
    const auto stamp_ns = static_cast<int64_t>(target.timestamp) * 1000;
    // The age is looked at before it is sent; a hog may come in between, and before the test's own look.
    EXPECT_LT(arrived_ns - stamp_ns, (arrived_ns > starved_ns ? 800 : 550) * kMs);
    const double frames = flight_time(stamp_ns) * 15;
    EXPECT_NEAR(frames, std::round(frames), 15 * 1e-3);
    const Vector3d in_body = pad_in_body_at(stamp_ns);
    const bool body = target.frame == mavlink::target_frame::kBodyFrd;
    const Vector3d truth = body ? in_body : truth_at(stamp_ns).ned_from_body.rotation * in_body;
    const Vector3d error = Vector3d(target.x, target.y, target.z) - truth;
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_LT(std::abs(error(axis)), 5 * target.pos_std[static_cast<size_t>(axis)] + 0.005);
  }
  EXPECT_GE(summary()["mavlink"]["refused"]["stale"], 1);
}

// A file that may grow no more, as on a disk that is full.
TEST_F(PerchLive, OnAFullDiskTheRecordingSuffersAndNothingElse) {
  const std::string command = std::string("ulimit -f 400; exec ") + PERCH_LIVE +
                              " --config run.yaml --summary summary.json --set "
                              "'outputs.record={folder: flights, format: ffv1}'";
  ChildProgram live(folder_, "/bin/sh", {"-c", command});
  fly_with(live);
  EXPECT_TRUE(live.says("File too large", kPatience)) << live.err();
  EXPECT_TRUE(landing_targets_come(monotonic_ns(), 15)) << live.err();
  EXPECT_EQ(live.stop(), 0) << live.err();
  const json recording = summary()["recording"];
  EXPECT_GE(recording["frames_dropped"], 10);
  EXPECT_THAT(recording["last_problem"].get<std::string>(), HasSubstr("File too large"));
  EXPECT_EQ(recording["rows_dropped"], 0);
  // What there is of it opens: the pictures before, and the estimates of all.
  const Flight flight = read_flight((folder_ / "x").parent_path() / recording["folder"].get<std::string>());
  EXPECT_THAT(flight.problems, testing::IsEmpty());
}

}  // namespace
}  // namespace perch
