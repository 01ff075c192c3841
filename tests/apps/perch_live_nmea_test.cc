// perch-live with a receiver in place of an autopilot, as configs/live/nmea.yaml has it.

#include "apps/live_rig.h"
#include "links/nmea/fake_receiver.h"
#include "perch/flight/flight.h"
#include "perch/flight/recorded_aids.h"

namespace perch {
namespace {

using nmea::FakeReceiver;

constexpr int64_t kReceiverLatency = 30 * kMs;

// The fake receiver in real time, behind a serial server: ten positions and fifty attitudes a second.
class RealTimeReceiver {
 public:
  explicit RealTimeReceiver(std::function<nmea::ReceiverTruth(int64_t)> truth, bool with_attitude)
      : truth_(std::move(truth)), with_attitude_(with_attitude), thread_([this] { run(); }) {}
  ~RealTimeReceiver() {
    stop_ = true;
    thread_.join();
  }

 private:
  void run() {
    std::vector<uint8_t> buffer(2048);
    for (int64_t next_ns = monotonic_ns() / kMs * kMs; !stop_; next_ns += 20 * kMs) {
      while (monotonic_ns() < next_ns + kReceiverLatency) sleep(0.001);
      const int64_t of_day_ms = next_ns / kMs + 3'600'000;
      const auto truth = truth_(next_ns);
      std::string said = with_attitude_ ? FakeReceiver::pashr(of_day_ms, truth) : "";
      if (next_ns / (20 * kMs) % 5 == 0)
        said += receiver_.gga(of_day_ms, truth) + receiver_.rmc(of_day_ms, truth);
      pollfd waiting{wire_.descriptor(), POLLIN, 0};
      if (poll(&waiting, 1, 0) > 0) wire_.read(buffer);
      wire_.write({reinterpret_cast<const uint8_t*>(said.data()), said.size()});
    }
  }
  const std::function<nmea::ReceiverTruth(int64_t)> truth_;
  const bool with_attitude_;
  FakeReceiver receiver_;

 public:
  mavlink::TcpWire wire_;

 private:
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

class PerchLiveNmea : public PerchLive {
 protected:
  std::unique_ptr<RealTimeReceiver> receiver(bool with_attitude) {
    return std::make_unique<RealTimeReceiver>(
        [this](int64_t ns) {
          if (begin_ns_ == 0) return nmea::ReceiverTruth{};
          const mavlink::TrueMotion motion = truth_at(ns);
          return nmea::ReceiverTruth{motion.ned_from_body, motion.body_velocity_in_ned};
        },
        with_attitude);
  }
  // The example, with this camera and this receiver.
  ChildProgram start_example(const RealTimeReceiver& receiver) const {
    std::string url = receiver.wire_.url();
    url.replace(0, std::string("mavlink").size(), "nmea");
    const FakeReceiver said;
    char origin[120];
    std::snprintf(
        origin, sizeof(origin), "nav.origin={latitude_deg: %.12f, longitude_deg: %.12f, height: %.3f}",
        said.origin.latitude * kDegFromRad, said.origin.longitude * kDegFromRad, said.origin.height);
    const std::string target = "target=" + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml";
    return {
        folder_,
        PERCH_LIVE,
        {"--config", std::string(PERCH_SOURCE_DIR) + "/configs/live/nmea.yaml", "--summary", "summary.json",
         "--set", target, "--set", "camera={source: 'sim:" + (folder_ / "sim.yaml").string() + "'}", "--set",
         "frames={time_offset: -0.03}", "--set", "nav.source=" + url, "--set", origin, "--set",
         "outputs.record=" + (folder_ / "flights").string()}};
  }
  Flight recorded() const {
    for (const auto& entry : fs::directory_iterator(folder_ / "flights")) return read_flight(entry.path());
    return {};
  }
};

TEST_F(PerchLiveNmea, ItsPositionsAndAttitudesAreRecordedAndTellGravity) {
  const auto said = receiver(true);
  ChildProgram live = start_example(*said);
  fly_with(live);
  sleep(6);
  EXPECT_EQ(live.stop(), 0) << live.err();
  const json nmea = summary()["nmea"];
  EXPECT_EQ(nmea["fix"], "RTK fixed");
  EXPECT_EQ(nmea["satellites"], 14);
  EXPECT_NEAR(nmea["sigma_m"]["horizontal"].get<double>(), 0.0113, 1e-3);
  EXPECT_GT(nmea["fixes"], 20);
  EXPECT_THAT(live.err(), HasSubstr("receiver RTK fixed, 14 satellites, 0.011 m by its HDOP"));

  const Flight flight = recorded();
  ASSERT_GT(flight.nav.samples.size(), 20u);
  size_t compared = 0;
  for (const NavSample& sample : flight.nav.samples) {
    // Before the flight began it had nothing true to say.
    const int64_t then = sample.timestamp_ns - kReceiverLatency;
    if (flight_time(then) < 1.5) continue;
    ++compared;
    const mavlink::TrueMotion truth = truth_at(then);
    // 1 m/s and 0.3 rad/s, and the quickest of 300 sentences came some ms late on a machine that others load.
    EXPECT_LT((sample.world_from_body.translation - truth.ned_from_body.translation).norm(), 0.02);
    EXPECT_LT(sample.world_from_body.rotation.angularDistance(truth.ned_from_body.rotation), 0.01);
  }
  EXPECT_GT(compared, 15u);
  // Attitudes for the filter, and beside most pictures.
  const std::string aids = read_file(flight.folder / "run" / "aids.csv");
  size_t autopilot = 0, frames = 0, known = 0;
  std::istringstream lines(aids);
  for (std::string line; std::getline(lines, line);) {
    autopilot += line.find(",autopilot,") != std::string::npos;
    const size_t frame = line.find(",frame,");
    frames += frame != std::string::npos;
    // Empty fields right after the number of rows: no attitude.
    known += frame != std::string::npos && line.find(",,,", frame) != line.find(',', frame + 7);
  }
  EXPECT_GT(autopilot, 100u);
  EXPECT_GT(frames, 20u);
  EXPECT_GT(known, frames / 3);
}

TEST_F(PerchLiveNmea, PositionsAloneAreRecordedWithoutAnAttitude) {
  const auto said = receiver(false);
  ChildProgram live = start_example(*said);
  fly_with(live);
  sleep(6);
  EXPECT_EQ(live.stop(), 0) << live.err();
  const Flight flight = recorded();
  ASSERT_GT(flight.nav.samples.size(), 10u);
  for (const NavSample& sample : flight.nav.samples) EXPECT_FALSE(sample.knows_attitude());
  const NavSample& last = flight.nav.samples.back();
  EXPECT_LT((last.world_from_body.translation -
             truth_at(last.timestamp_ns - kReceiverLatency).ned_from_body.translation)
                .norm(),
            0.05);
  EXPECT_THAT(flight.problems, testing::Contains(HasSubstr("rows without an attitude")));
}

TEST_F(PerchLiveNmea, RefusesAWrongConfigurationWithItsPlace) {
  const auto error_of = [&](const std::string& set) {
    const Outcome outcome = run_program_in(
        folder_, PERCH_LIVE, "--config run.yaml --set outputs.mavlink.send=false --set '" + set + "'");
    EXPECT_EQ(outcome.code, 2) << set;
    return outcome.err;
  };
  EXPECT_THAT(error_of("nav=nmea+tcp:host"), HasSubstr("nav: expected nmea+ and the URL of a byte stream"));
  EXPECT_THAT(error_of("nav={source: \"nmea+tcp://h:1\", origin: {latitude_deg: 1}}"),
              HasSubstr("longitude_deg: expected"));
  EXPECT_THAT(
      error_of("nav={source: \"nmea+tcp://h:1\", origin: {latitude_deg: 91, longitude_deg: 0, height: 0}}"),
      HasSubstr("nav.origin.latitude_deg: expected"));
  EXPECT_THAT(
      error_of("nav={source: \"mavlink+tcp://h:1\", origin: {latitude_deg: 1, longitude_deg: 0, height: 0}}"),
      HasSubstr("nav.origin: expected nothing, as the autopilot has its own"));
  EXPECT_THAT(error_of("nav={source: \"nmea+tcp://h:1\", rate: 5}"), HasSubstr("nav.rate"));
}

}  // namespace
}  // namespace perch
