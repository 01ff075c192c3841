// perch-live and a gimbal of the vehicle's by MAVLink: the autopilot's manager is asked for control, told
// rates, and tells where the gimbal looks; the simulated camera turns with it.

#include <limits>

#include "apps/live_rig.h"
#include "perch/geometry/euler.h"
#include "perch/links/mavlink/gimbal_camera.h"
#include "support/free_port.h"

namespace perch {
namespace {

using mavlink::GimbalDeviceAttitudeStatus;
using mavlink::GimbalManagerSetPitchyaw;

// Yaw and pitch against the vehicle, as it was told.
class FakeGimbal {
 public:
  void advance(int64_t now_ns) {
    const double dt = then_ns_ == 0 ? 0 : 1e-9 * static_cast<double>(now_ns - then_ns_);
    then_ns_ = now_ns;
    yaw = std::clamp(yaw + yaw_rate_ * dt, -2.0, 2.0);
    pitch = std::clamp(pitch + pitch_rate_ * dt, -1.5, 0.4);
  }
  void hear(const mavlink::Frame& frame, int64_t now_ns) {
    const auto set = mavlink::decode<GimbalManagerSetPitchyaw>(frame);
    if (!set) return;
    advance(now_ns);
    ++sets;
    yaw_rate_ = std::isfinite(set->yaw_rate) ? set->yaw_rate : 0;
    pitch_rate_ = std::isfinite(set->pitch_rate) ? set->pitch_rate : 0;
    if (std::isfinite(set->yaw)) yaw = set->yaw;
    if (std::isfinite(set->pitch)) pitch = set->pitch;
  }
  // Against the horizon and the vehicle's heading.
  GimbalDeviceAttitudeStatus status(int64_t now_ns, const Eigen::Quaterniond& ned_from_body) {
    advance(now_ns);
    const Eigen::Vector3d forward = ned_from_body * Eigen::Vector3d::UnitX();
    const Eigen::Quaterniond q =
        Eigen::AngleAxisd(-std::atan2(forward.y(), forward.x()), Eigen::Vector3d::UnitZ()) * ned_from_body *
        rotation_from_ypr({yaw, pitch, 0});
    GimbalDeviceAttitudeStatus status;
    status.q = {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
                static_cast<float>(q.z())};
    status.flags = mavlink::kGimbalYawInVehicleFrame;
    return status;
  }

  double yaw = 0.2, pitch = -0.3;  // rad
  int sets = 0;

 private:
  double yaw_rate_ = 0, pitch_rate_ = 0;
  int64_t then_ns_ = 0;
};

class LiveGimbal : public PerchLive {
 protected:
  LiveGimbal()
      : port_(std::to_string(free_udp_port())), truth_(parse_stream_url("udp://127.0.0.1:" + port_)) {
    const std::string target = "target: " + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml\n";
    // Hung so that it looks forward at zero angles; the pad comes to be 45 degrees and more below.
    const std::string mount = "{position: [0.1, 0, 0.05], rotation: {ypr_deg: [90, 0, 90]}}";
    folder_.write("sim.yaml", target +
                                  "camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, rate_hz: 15,\n"
                                  "  intrinsics: [226, 226, 159.5, 119.5], body_from_camera: " +
                                  mount + ", head: 'udp:127.0.0.1:" + port_ +
                                  "'}\nflight: {start_height: 3, start_aside: 3, touchdown_height: 2.5,"
                                  " touchdown_aside: 2.2, duration: 6, hover: 120}\n");
    folder_.write("run.yaml",
                  target + "camera: {source: 'sim:sim.yaml'}\nframes: {base_from_camera: {pan_tilt: {}}}\n" +
                      "ptz: {device: mavlink}\nnav: " + autopilot_.url() + "\noutputs: {mavlink: {}}\n");
    flight_ = std::make_unique<SimulatedFlight>(read_simulation(Section::load(folder_ / "sim.yaml")));
    autopilot_.with([this](auto& autopilot) {
      autopilot.on_frame = [this](const mavlink::Frame& frame, int64_t t) { gimbal_.hear(frame, t); };
      autopilot.gimbal = [this, &autopilot](int64_t t) {
        return gimbal_.status(t, autopilot.motion(t).ned_from_body.rotation);
      };
    });
    teller_ = std::thread([this] {
      for (; !stop_; sleep(0.004)) tell_truth();
    });
  }
  ~LiveGimbal() override {
    stop_ = true;
    teller_.join();
    autopilot_.with([](auto& autopilot) {
      autopilot.on_frame = {};
      autopilot.gimbal = {};
    });
  }
  void tell_truth() {
    const auto line = autopilot_.with([this](auto&) {
      const int64_t now_ns = monotonic_ns();
      gimbal_.advance(now_ns);
      return std::to_string(now_ns) + " " + std::to_string(gimbal_.yaw) + " " +
             std::to_string(gimbal_.pitch) + " 0\n";
    });
    truth_.write({reinterpret_cast<const uint8_t*>(line.data()), line.size()});
    truth_.run(std::chrono::nanoseconds(0), [](const Chunk&) {});
  }

  FakeGimbal gimbal_;
  std::string port_;
  ByteStream truth_;
  std::atomic<bool> stop_ = false;
  std::thread teller_;
};

TEST_F(LiveGimbal, FollowsThePadAndTheAutopilotIsToldWhereItIs) {
  ChildProgram live = start();
  fly_with(live);
  ASSERT_TRUE(landing_targets_come(0, 40)) << live.err();
  // Down at the pad, straight ahead.
  const auto at_the_pad = [this] {
    return autopilot_.with([this](auto&) { return std::abs(gimbal_.yaw) < 0.15 && gimbal_.pitch < -0.6; });
  };
  for (double t = 0; t < kPatience && !at_the_pad(); t += 0.02) sleep(0.02);
  EXPECT_TRUE(at_the_pad());
  EXPECT_EQ(live.stop(), 0) << live.err();
  // The gimbal's attitude is told to the millisecond, at 50 Hz; it turns at some 0.3 rad/s, 3 m away.
  int close = 0;
  const auto targets = autopilot_.landing_targets();
  for (const auto& [arrived_ns, target] : targets) {
    const int64_t then_ns = arrived_ns - 62 * kMs;  // PLND_LAG
    close += (Eigen::Vector3d(target.x, target.y, target.z) - pad_in_body_at(then_ns)).norm() < 0.1;
  }
  EXPECT_GT(close, 0.9 * static_cast<double>(targets.size()));
  const json gimbal = summary()["mavlink"]["gimbal"];
  EXPECT_TRUE(gimbal["controlled"]);
  EXPECT_GT(gimbal["followed"], 30);
  EXPECT_GT(autopilot_.with([](auto& a) { return a.heard[GimbalManagerSetPitchyaw::kId]; }), 20);
}

// What somebody else steers: its angles are heard, and nothing is told.
TEST_F(LiveGimbal, ThatIsNotToFollowIsLeftToWhoeverMovesIt) {
  ChildProgram live = start({"--set", "ptz.follow=false"});
  fly_with(live);
  sleep(3);
  const auto told = autopilot_.with(
      [&](auto& a) { return std::pair(a.heard[GimbalManagerSetPitchyaw::kId], gimbal_.pitch); });
  EXPECT_EQ(live.stop(), 0) << live.err();
  EXPECT_EQ(told.first, 0);
  EXPECT_EQ(told.second, -0.3);
  EXPECT_EQ(autopilot_.with([](auto& a) { return a.heard[GimbalManagerSetPitchyaw::kId]; }), 0);
}

TEST_F(LiveGimbal, IsAnErrorWithoutTheAutopilotOrWithAZoom) {
  for (const auto& [set, message] : {std::pair("nav=none", "ptz.device: expected mavlink with nav"),
                                     {"ptz.fill=0.5", "ptz.fill: expected none"}}) {
    ChildProgram live = start({"--set", set, "--set", "outputs={}"});
    EXPECT_EQ(live.wait(20), 2) << set;
    EXPECT_TRUE(live.says(message, 1)) << live.err();
  }
}

}  // namespace
}  // namespace perch
