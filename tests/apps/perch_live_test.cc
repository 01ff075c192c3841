// perch-live as a pilot starts it: a simulated camera, and an autopilot at the other end of a UDP link whose
// clock is offset and drifts and whose messages come late and jitter.

#include <sys/un.h>

#include <algorithm>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "apps/live_rig.h"
#include "perch/flight/estimates_file.h"

namespace perch {
namespace {

// The bound of a vector's error: what the estimator itself says, and what a prediction from exposure to send
// time cannot know: at 2 m/s^2 over 0.15 s, which a busy machine may take, 2 cm.
constexpr double kPredicted = 0.02;  // m
// What is older when it arrives is late. How far off it is is not said; it is to be the exception.
constexpr int64_t kLate = 150 * kMs;

TEST_F(PerchLive, TellsArdupilotWhereThePadIsAndWhen) {
  ChildProgram live = start({"--output", "out"});
  fly_with(live);
  ASSERT_TRUE(landing_targets_come(0, 30)) << live.err();
  EXPECT_TRUE(live.says("pad TRACK", kPatience));
  EXPECT_EQ(live.stop(), 0) << live.err();
  const json closing = summary();
  // The last are on their way.
  const size_t sent_count = closing["mavlink"]["sent"];
  EXPECT_TRUE(landing_targets_come(0, sent_count));
  EXPECT_EQ(sent_count, autopilot_.landing_targets().size());

  std::vector<std::string> problems;
  std::map<int64_t, VehicleState> states;  // by the stamp, us
  for (const VehicleState& state : read_states(folder_ / "out/states.csv", problems))
    states[state.timestamp_ns / 1000] = state;
  const double frame_ns = 1e9 / 15;
  int64_t last_stamp = 0;
  size_t late = 0;
  for (const auto& [arrived_ns, target] : autopilot_.landing_targets()) {
    EXPECT_EQ(target.frame, mavlink::mav_frame::kBodyFrd);
    EXPECT_EQ(target.position_valid, 1);
    EXPECT_EQ(target.q, (std::array<float, 4>{}));
    const Eigen::Vector3d sent(target.x, target.y, target.z);
    EXPECT_NEAR(target.distance, sent.norm(), 1e-6 * sent.norm());  // floats
    // Of an exposure of the simulated camera, each newer than the last.
    const auto stamp_ns = static_cast<int64_t>(target.time_usec) * 1000;
    EXPECT_GT(stamp_ns, last_stamp);
    last_stamp = stamp_ns;
    const double frames = static_cast<double>(stamp_ns - begin_ns_) / frame_ns;
    EXPECT_NEAR(frames * frame_ns, std::round(frames) * frame_ns, 2e6);
    // Where the pad is as of the send time less PLND_LAG.
    const auto state = states.find(static_cast<int64_t>(target.time_usec));
    ASSERT_NE(state, states.end());
    EXPECT_EQ(state->second.source, StateSource::kVision);
    const double sigma = std::sqrt(
        inverse(UncertainRigid3{state->second.pad_from_body, state->second.covariance.topLeftCorner<6, 6>()})
            .covariance.topLeftCorner<3, 3>()
            .trace());
    const int64_t lag_ns =
        autopilot_.with([](auto& a) { return std::llround(a.parameters["PLND_LAG"] * 1e9); });
    const Eigen::Vector3d truth = pad_in_body_at(arrived_ns - lag_ns);
    if (arrived_ns - stamp_ns > kLate) {
      ++late;
      continue;
    }
    EXPECT_LT((sent - truth).norm(), 4 * sigma + kPredicted)
        << "sent " << sent.transpose() << ", true " << truth.transpose() << ", sigma " << sigma;
  }
  EXPECT_LT(2 * late, sent_count);
  EXPECT_THAT(autopilot_.with([](auto& a) { return mavlink::text_of(a.texts.at(0).text); }),
              HasSubstr("Perch: pad "));
  EXPECT_GE(closing["latency_us"]["total"]["count"], 30);
  EXPECT_NEAR(closing["mavlink"]["clock"]["skew"].get<double>(), 50e-6, 200e-6);  // of seconds with ms jitter
}

TEST_F(PerchLive, SaysNothingWrongThroughFaultsAndRecovers) {
  autopilot_.with([](auto& autopilot) { autopilot.parameters["PLND_LAG"] = 0.02; });
  ChildProgram live = start();
  fly_with(live);
  ASSERT_TRUE(landing_targets_come(0, 5)) << live.err();

  // Garbage, half a frame, another vehicle's heartbeat and attitude.
  std::vector<uint8_t> foreign, garbage(300, 0xFD);
  mavlink::FrameWriter other(42, 1);
  mavlink::Heartbeat heartbeat;
  heartbeat.autopilot = mavlink::mav_autopilot::kPx4;
  other.append(foreign, heartbeat);
  other.append(foreign, mavlink::AttitudeQuaternion{1, 0, 1, 0, 0, 9, 9, 9, {}});
  for (int i = 0; i < 50; ++i) {
    autopilot_.send_raw(garbage);
    autopilot_.send_raw({foreign.begin(), foreign.begin() + 15});
    autopilot_.send_raw(foreign);
    sleep(0.005);  // no more at once than a socket holds
  }
  // Its clock is set; it loses half of all it hears and says.
  autopilot_.with([](auto& autopilot) { autopilot.booted_ns -= 3 * kSecond; });
  sleep(0.7);
  autopilot_.with([](auto& autopilot) { autopilot.loss = 0.5; });
  const int64_t lossy_ns = monotonic_ns();
  EXPECT_TRUE(landing_targets_come(lossy_ns, 10)) << live.err();
  // The link is cut for longer than heartbeats may be missing, and comes back.
  autopilot_.with([](auto& autopilot) {
    autopilot.loss = 0;
    autopilot.silent = true;
  });
  EXPECT_TRUE(live.says("link lost", kPatience)) << live.err();
  const int64_t lost_ns = monotonic_ns();
  sleep(0.5);
  EXPECT_TRUE(landing_targets_since(lost_ns + 20 * kMs).empty());
  autopilot_.with([](auto& autopilot) { autopilot.silent = false; });
  const int64_t back_ns = monotonic_ns();
  EXPECT_TRUE(landing_targets_come(back_ns, 10)) << live.err();
  EXPECT_EQ(live.stop(), 0) << live.err();

  const auto targets = autopilot_.landing_targets();
  size_t late = 0;
  for (const auto& [arrived_ns, target] : targets) {
    const Eigen::Vector3d sent(target.x, target.y, target.z);
    const Eigen::Vector3d truth = pad_in_body_at(arrived_ns - 20 * kMs);
    const auto stamp_ns = static_cast<int64_t>(target.time_usec) * 1000;
    late += arrived_ns - stamp_ns > kLate;
    // Far less than any fault would make it: half a turn, 3 s.
    EXPECT_LT((sent - truth).norm(), arrived_ns - stamp_ns > kLate ? 0.5 : 0.1)
        << sent.transpose() << ", true " << truth.transpose();
    EXPECT_LT(arrived_ns - stamp_ns, 500 * kMs);
    EXPECT_GE(arrived_ns - stamp_ns, 0);
  }
  EXPECT_LT(2 * late, targets.size());
  const json mavlink = summary()["mavlink"];
  EXPECT_GE(mavlink["heard"]["foreign"], 50);
  EXPECT_GE(mavlink["heard"]["skipped_bytes"], 50 * 300);
  EXPECT_GE(mavlink["clock"]["steps"], 1);
  EXPECT_EQ(mavlink["heard"]["times_lost"], 1);
  EXPECT_EQ(mavlink["heard"]["times_up"], 2);
  EXPECT_GT(mavlink["refused"]["no link"], 0);
}

// Without the times that a stage took: the last three columns.
std::string estimates_without_times(const fs::path& file) {
  std::istringstream rows(read_file(file));
  std::string kept;
  for (std::string row; std::getline(rows, row);) {
    for (int i = 0; i < 3; ++i) row.erase(row.rfind(','));
    kept += row + '\n';
  }
  return kept;
}

TEST_F(PerchLive, ARecordedRunIsReplayedBitForBit) {
  {
    ChildProgram live = start({"--set", "outputs.record=flights"});
    fly_with(live);
    ASSERT_TRUE(landing_targets_come(0, 20)) << live.err();
    EXPECT_EQ(live.stop(), 0) << live.err();
  }
  EXPECT_EQ(summary()["recording"]["frames_dropped"], 0);
  const fs::path flight = summary()["recording"]["folder"].get<std::string>();
  const fs::path recorded = (folder_ / "x").parent_path() / flight;
  EXPECT_GT(fs::file_size(recorded / "run/mavlink.tlog"), 10'000u);
  EXPECT_TRUE(fs::exists(recorded / "run/summary.json"));
  EXPECT_THAT(read_file(recorded / "run/log"), testing::AllOf(HasSubstr("link up"), HasSubstr("ended; ")));
  const std::string config = recorded / "run/config.yaml";
  const TempFolder again, batch;
  ChildProgram live_again(again, PERCH_LIVE,
                          {"--config", config, "--output", "out", "--set", "camera.pace=fast", "--set",
                           "camera.source=flight:" + recorded.string()});
  ChildProgram batched(batch, PERCH_BATCH, {"--config", config, "--output", "out", recorded});
  ASSERT_EQ(live_again.wait(kPatience), 0) << live_again.err();
  ASSERT_EQ(batched.wait(kPatience), 0) << batched.err();
  const std::string live_rows = estimates_without_times(recorded / "run/estimates.csv");
  const std::string live_states = read_file(recorded / "run/states.csv");
  EXPECT_GT(std::count(live_rows.begin(), live_rows.end(), '\n'), 20);
  for (const fs::path& folder : {again / "out", batch / "out" / recorded.filename()}) {
    EXPECT_TRUE(estimates_without_times(folder / "estimates.csv") == live_rows)
        << folder << live_again.err() << batched.out() << batched.err();
    EXPECT_TRUE(read_file(folder / "states.csv") == live_states) << folder;
  }
}

TEST_F(PerchLive, ACameraThatHangsIsNotBelieved) {
  // The same picture again and again, with new times: the first is a measurement, the others are none.
  cv::imwrite((folder_ / "frozen.png").string(), flight_->picture(0));
  const std::string model =
      "{'lensmodel': 'LENSMODEL_PINHOLE', 'extrinsics': [0, 0, 0, 0, 0, 0], "
      "'intrinsics': [226, 226, 159.5, 119.5], 'imagersize': [320, 240]}";
  folder_.write("frozen.cameramodel", model);
  ChildProgram live = start(
      {"--set", "camera.model=frozen.cameramodel", "--set", "frames.body_from_base=identity", "--set",
       "camera.source=gst:multifilesrc location=" + (folder_ / "frozen.png").string() +
           " loop=true caps=image/png,framerate=15/1 ! pngdec ! videoconvert ! video/x-raw,format=GRAY8 ! "
           "identity sync=true"});
  EXPECT_TRUE(live.says("pad LOST", kPatience)) << live.err();
  sleep(2);  // thirty more of the same
  EXPECT_EQ(live.stop(), 0) << live.err();
  EXPECT_LE(autopilot_.landing_targets().size(), 1u);
  const json closing = summary();
  EXPECT_EQ(closing["frames"], 1);
  EXPECT_GT(closing["repeated"], 10);
}

// What it tells the service manager, as often as it was said.
class NotifySocket {
 public:
  explicit NotifySocket(const std::string& name) : fd_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  }
  ~NotifySocket() { close(fd_); }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  int count(const std::string& what) {
    char text[256];
    for (ssize_t size = 0; (size = recv(fd_, text, sizeof(text), MSG_DONTWAIT)) >= 0;)
      ++said_[std::string(text, static_cast<size_t>(size))];
    return said_[what];
  }
  bool says(const std::string& what, int times) {
    for (double t = 0; t < kPatience; t += 0.02, sleep(0.02)) {
      if (count(what) >= times) return true;
    }
    return false;
  }

 private:
  int fd_;
  std::map<std::string, int> said_;
};

// And a disk that takes no recording is no reason not to land.
TEST_F(PerchLive, TellsTheServiceManagerThatAllGoOnThoughThereIsNoRecording) {
  NotifySocket manager(folder_ / "notify");
  setenv("NOTIFY_SOCKET", (folder_ / "notify").c_str(), 1);
  // So seldom that the socket holds all that is said while nobody reads: a word that cannot be said is not.
  setenv("WATCHDOG_USEC", "3000000", 1);
  ChildProgram live = start({"--set", "outputs.record=run.yaml/flights"});
  unsetenv("NOTIFY_SOCKET");
  unsetenv("WATCHDOG_USEC");
  EXPECT_TRUE(manager.says("STATUS=TRACK", 1)) << live.err();
  const int fed = manager.count("WATCHDOG=1");
  EXPECT_TRUE(manager.says("WATCHDOG=1", fed + 2));
  live.signal(SIGHUP);
  EXPECT_TRUE(live.says("SIGHUP: nothing is reloaded", kPatience)) << live.err();
  EXPECT_EQ(live.stop(), 0) << live.err();
  EXPECT_EQ(manager.count("READY=1"), 1);
  EXPECT_EQ(manager.count("STOPPING=1"), 1);
  EXPECT_THAT(live.err(), HasSubstr("recording: there is none: "));
  EXPECT_THAT(summary()["recording"]["last_problem"].get<std::string>(), HasSubstr("Not a directory"));
  EXPECT_GE(summary()["frames"], 1);
}

}  // namespace
}  // namespace perch
