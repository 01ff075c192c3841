// perch-live before a flight: what is wrong with the autopilot, and with the configuration, is said.

#include "apps/live_rig.h"

namespace perch {
namespace {

TEST_F(PerchLive, TheDoctorSaysWhatIsWrong) {
  autopilot_.with([](auto& autopilot) {
    // One that is not there is asked for several times.
    for (const auto& name : mavlink::landing_parameters(autopilot.autopilot)) autopilot.parameters[name] = 1;
    autopilot.parameters["PLND_TYPE"] = 2;
  });
  // And a head that turns the camera, of which nobody tells.
  ChildProgram live(folder_, PERCH_LIVE,
                    {"--config", "run.yaml", "--check", "--set",
                     "frames.base_from_camera={pan_tilt: {base_from_zero: identity}}"});
  EXPECT_EQ(live.wait(2 * kPatience), 1) << live.err();
  EXPECT_THAT(live.out(), HasSubstr("autopilot: ArduPilot 4.6.0, system 1\n"));
  EXPECT_THAT(live.out(), HasSubstr("error: PLND_TYPE is 2: LANDING_TARGET is listened to"));
  EXPECT_THAT(live.out(), HasSubstr("error: gimbal rate is 0 Hz: the camera's direction is not known"));
  EXPECT_TRUE(autopilot_.landing_targets().empty());
}

TEST_F(PerchLive, RefusesAWrongConfigurationWithItsPlace) {
  const auto error_of = [&](const std::string& set) {
    const Outcome outcome = run_program_in(folder_, PERCH_LIVE, "--config run.yaml --set '" + set + "'");
    EXPECT_EQ(outcome.code, 2) << set;
    return outcome.err;
  };
  EXPECT_THAT(error_of("outputs.stations.listen=8080"), HasSubstr("outputs.stations: expected one of"));
  EXPECT_THAT(error_of("outputs.station.listen=8080"),
              HasSubstr("outputs.station.listen: expected ADDRESS:PORT"));
  EXPECT_THAT(error_of("nav=udp:1:2"), HasSubstr("nav: expected none, flight, mavlink+URL"));
  EXPECT_THAT(error_of("nav=mavlink+udp:host"), HasSubstr("expected HOST:PORT"));
  EXPECT_THAT(error_of("nav=none"),
              HasSubstr("outputs.mavlink.send: expected false, as nav is no autopilot"));
  EXPECT_THAT(error_of("nav=flight"), HasSubstr("as camera.source is no flight"));
  EXPECT_THAT(error_of("camera.source=gst:videotestsrc"), HasSubstr("camera.model: expected"));
}

}  // namespace
}  // namespace perch
