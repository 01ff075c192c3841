// perch-live with each profile, over each kind of link, signed or not, end to end.

#include "apps/live_rig.h"

namespace perch {
namespace {

using Eigen::Vector3d;

// The estimator's own sigma on this flight (1.5 to 4 m, f = 226 px) is 1 to 6 mm; the fake autopilot's
// attitude is late to the millisecond of its stamps, and its position is a cubic through samples 33 ms apart.
constexpr double kClose = 0.03;  // m

Vector3d ned_of_pad() { return Simulation().world_from_pad.translation; }

class OverTcp : public PerchLive {
 protected:
  OverTcp() : PerchLive(std::make_unique<mavlink::TcpWire>()) {
    autopilot_.with([](auto& autopilot) {
      autopilot.autopilot = mavlink::mav_autopilot::kPx4;
      autopilot.parameters = {{"VTE_EN", 0}};
    });
  }
};

TEST_F(OverTcp, Px4IsToldWhereThePadIsInItsOwnMap) {
  ChildProgram live = start();
  fly_with(live);
  ASSERT_TRUE(landing_targets_come(0, 20)) << live.err();
  EXPECT_EQ(live.stop(), 0) << live.err();
  for (const auto& [arrived_ns, target] : autopilot_.landing_targets()) {
    EXPECT_EQ(target.frame, mavlink::mav_frame::kLocalNed);
    EXPECT_EQ(target.position_valid, 1);
    EXPECT_LT((Vector3d(target.x, target.y, target.z) - ned_of_pad()).norm(), kClose);
    const auto stamp_ns = static_cast<int64_t>(target.time_usec) * 1000;
    EXPECT_NEAR(target.distance, pad_in_body_at(stamp_ns).norm(), kClose);
    // Of our own clock, which PX4 matches to its own: an exposure's.
    const double frames = flight_time(stamp_ns) * 15;
    EXPECT_NEAR(frames, std::round(frames), 15 * 2e-3);
  }
  EXPECT_EQ(summary()["mavlink"]["profile"], "px4");
  EXPECT_GT(autopilot_.with([](auto& a) { return a.heard[mavlink::Timesync::kId]; }), 10);
}

class OverASerialLine : public PerchLive {
 protected:
  OverASerialLine() : PerchLive(std::make_unique<mavlink::PtyWire>()) {
    autopilot_.with([](auto& autopilot) {
      autopilot.autopilot = mavlink::mav_autopilot::kPx4;
      autopilot.parameters = {{"VTE_EN", 1}};
    });
  }
};

TEST_F(OverASerialLine, ThatLosesHalvesOfFramesPx4sEstimatorIsToldWithItsUncertainty) {
  autopilot_.cut_every(10);
  ChildProgram live = start();
  fly_with(live);
  for (double t = 0; t < kPatience && autopilot_.relative_targets().size() < 20; t += 0.02) sleep(0.02);
  EXPECT_EQ(live.stop(), 0) << live.err();
  const auto targets = autopilot_.relative_targets();
  ASSERT_GE(targets.size(), 20u) << live.err();
  for (const auto& [arrived_ns, target] : targets) {
    const auto stamp_ns = static_cast<int64_t>(target.timestamp) * 1000;
    const bool body = target.frame == mavlink::target_frame::kBodyFrd;
    EXPECT_TRUE(body || target.frame == mavlink::target_frame::kLocalOffsetNed);
    const Vector3d in_body = pad_in_body_at(stamp_ns);
    const Vector3d truth = body ? in_body : truth_at(stamp_ns).ned_from_body.rotation * in_body;
    const Vector3d error = Vector3d(target.x, target.y, target.z) - truth;
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GT(target.pos_std[static_cast<size_t>(axis)], 0);
      // Attitudes between stamps of whole milliseconds, at 0.3 rad/s and 4 m, are off by a millimetre.
      EXPECT_LT(std::abs(error(axis)), 5 * target.pos_std[static_cast<size_t>(axis)] + 0.005);
    }
  }
  EXPECT_TRUE(autopilot_.landing_targets().empty());
  const json mavlink = summary()["mavlink"];
  EXPECT_EQ(mavlink["profile"], "px4-vte");
  EXPECT_GE(mavlink["heard"]["bad_crc"].get<int>() + mavlink["heard"]["skipped_bytes"].get<int>(), 5);
  EXPECT_EQ(mavlink["heard"]["times_lost"], 0);
}

class OverASerialLineThatOnlyAnswers : public PerchLive {
 protected:
  OverASerialLineThatOnlyAnswers() : PerchLive(std::make_unique<mavlink::PtyWire>()) {
    autopilot_.with([](auto& autopilot) { autopilot.only_answers = true; });
  }
};

TEST_F(OverASerialLineThatOnlyAnswers, ItIsAskedForEachMessageAndToldWhereThePadIs) {
  // The paper's has no clock that anybody could match.
  autopilot_.with([](auto& autopilot) {
    autopilot.unanswered = {mavlink::Timesync::kId, mavlink::SystemTime::kId};
    autopilot.loss = 0.02;
  });
  std::string url = autopilot_.url();
  url.replace(0, std::string("mavlink").size(), "mavlink-request");
  ChildProgram live = start({"--set", "nav=" + url});
  fly_with(live);
  ASSERT_TRUE(landing_targets_come(0, 40)) << live.err();
  // It is asked for its version every two seconds, and that may have been lost so far.
  autopilot_.with([](auto& autopilot) { autopilot.loss = 0; });
  ASSERT_TRUE(landing_targets_come(monotonic_ns(), 45)) << live.err();
  EXPECT_EQ(live.stop(), 0) << live.err();
  const json mavlink = summary()["mavlink"];
  EXPECT_EQ(mavlink["autopilot"], "ArduPilot 4.6.0, system 1");
  EXPECT_GT(mavlink["requests"]["answered"], 50);
  EXPECT_GT(mavlink["requests"]["timed_out"], 0);
  EXPECT_GT(mavlink["requests"]["times_by_round_trip"], 20);
  EXPECT_TRUE(autopilot_.with([](auto& a) { return a.intervals.empty(); }));
  const auto targets = autopilot_.landing_targets(20 * kMs);
  EXPECT_GE(targets.size(), 20u);
  size_t off = 0;
  for (const auto& [arrived_ns, target] : targets) {
    // ArduPilot takes it for PLND_LAG old.
    const Vector3d truth = pad_in_body_at(arrived_ns - 62'500'000);
    off += (Vector3d(target.x, target.y, target.z) - truth).norm() > 0.1;
  }
  EXPECT_LE(off, targets.size() / 10);
}

class Signed : public PerchLive {
 protected:
  Signed()
      : PerchLive(std::make_unique<mavlink::UdpWire>(),
                  std::make_unique<mavlink::Signing>(mavlink::SigningOptions{key_of(7), 3, true}, now())) {}
  static std::array<uint8_t, 32> key_of(uint8_t byte) {
    std::array<uint8_t, 32> key{};
    key.fill(byte);
    return key;
  }
  static uint64_t now() {
    return mavlink::signing_time(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                     std::chrono::system_clock::now().time_since_epoch())
                                     .count());
  }
  ChildProgram start_with_key(uint8_t byte) {
    folder_.write("link.key", std::string(32, static_cast<char>(byte)));
    return start({"--set", "outputs.mavlink.signing.key=link.key"});
  }
};

TEST_F(Signed, WithTheSameKeyAllIsUnderstoodAndNothingGoesUnsigned) {
  ChildProgram live = start_with_key(7);
  fly_with(live);
  EXPECT_TRUE(landing_targets_come(0, 5)) << live.err();
  EXPECT_EQ(live.stop(), 0) << live.err();
  EXPECT_EQ(autopilot_.unsigned_frames(), 0u);
  EXPECT_EQ(summary()["mavlink"]["heard"]["bad_signature"], 0);
  // The fake autopilot understood: streams were asked for with signed commands.
  EXPECT_GT(autopilot_.with([](auto& a) { return a.intervals.size(); }), 0u);
}

TEST_F(Signed, WithAnotherKeyOrWithoutOneNobodyIsHeardAndNothingSent) {
  ChildProgram live = start_with_key(8);
  fly_with(live);
  // Without a signature: the heartbeat of somebody who would like to be the autopilot.
  std::vector<uint8_t> forged;
  mavlink::FrameWriter writer(1, 1);
  mavlink::Heartbeat heartbeat;
  heartbeat.autopilot = mavlink::mav_autopilot::kArdupilot;
  writer.append(forged, heartbeat);
  for (int i = 0; i < 15; ++i, sleep(0.1)) autopilot_.send_raw(forged);
  EXPECT_EQ(live.stop(), 0) << live.err();
  EXPECT_TRUE(autopilot_.landing_targets().empty());
  const json mavlink = summary()["mavlink"];
  EXPECT_EQ(mavlink["link"], "silent");
  EXPECT_GE(mavlink["heard"]["bad_signature"], 5);  // a heartbeat a second and ours, from when it first spoke
  EXPECT_EQ(mavlink["sent"], 0);
}

}  // namespace
}  // namespace perch
