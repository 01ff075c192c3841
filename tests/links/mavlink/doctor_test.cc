#include "perch/links/mavlink/doctor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "links/mavlink/fake_autopilot.h"

namespace perch::mavlink {
namespace {

VehicleSnapshot healthy(uint8_t autopilot) {
  VehicleSnapshot is;
  is.heard = true;
  is.autopilot.system = 1;
  is.autopilot.autopilot = autopilot;
  is.clock = ClockEstimate{0, 0, 0, 500'000, 2'000'000};
  is.attitude_hz = 100;
  is.position_hz = 30;
  is.range_hz = 10;
  is.latency = 0.06;
  return is;
}

VehicleSnapshot healthy_ardupilot() {
  VehicleSnapshot is = healthy(mav_autopilot::kArdupilot);
  is.profile = LandingProfile::kArdupilot;
  is.parameters = {
      {"PLND_ENABLED", 1},    {"PLND_TYPE", 1},          {"PLND_EST_TYPE", 1},   {"PLND_YAW_ALIGN", 0},
      {"PLND_CAM_POS_X", 0},  {"PLND_CAM_POS_Y", 0},     {"PLND_CAM_POS_Z", 0},  {"PLND_ORIENT", 25},
      {"PLND_LAG", 0.06},     {"PLND_XY_DIST_MAX", 2.5}, {"PLND_ALT_MIN", 0.75}, {"PLND_ALT_MAX", 8},
      {"PLND_STRICT", 1},     {"PLND_RET_MAX", 4},       {"PLND_OPTIONS", 0},    {"PLND_LAND_OFS_X", 0},
      {"PLND_LAND_OFS_Y", 0}, {"RNGFND1_TYPE", 10},      {"RNGFND1_ORIENT", 25}};
  return is;
}

VehicleSnapshot healthy_px4() {
  VehicleSnapshot is = healthy(mav_autopilot::kPx4);
  is.profile = LandingProfile::kPx4;
  is.odometry_hz = 30;
  is.global_hz = 1;
  is.asked_for_time = 600;
  is.parameters = {{"RTL_PLD_MD", 2},       {"PLD_BTOUT", 5},        {"PLD_HACC_RAD", 0.2},
                   {"PLD_MAX_SRCH", 3},     {"LTEST_SENS_POS_X", 0}, {"LTEST_SENS_POS_Y", 0},
                   {"LTEST_SENS_POS_Z", 0}, {"LTEST_SENS_ROT", 0}};
  is.absent = {"VTE_EN"};
  return is;
}

VehicleSnapshot healthy_vte() {
  VehicleSnapshot is = healthy_px4();
  is.profile = LandingProfile::kPx4Vte;
  is.absent.clear();
  is.parameters.merge(std::map<std::string, double>{{"VTE_EN", 1},
                                                    {"VTE_AID_MASK", 14},
                                                    {"VTE_EVP_NOISE", 0.02},
                                                    {"VTE_EVA_NOISE", 0.05},
                                                    {"VTE_EV_NOISE_MD", 0}});
  return is;
}

std::string all_text(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& finding : findings) text += to_text(finding) + "\n";
  return text;
}

struct Case {
  std::function<void(VehicleSnapshot&)> spoil;
  FindingSeverity severity;
  std::string subject, found, remedy;  // what the text must say
};

// Each case has this one finding and no other.
void expect_each(const VehicleSnapshot& good, const std::vector<Case>& cases) {
  EXPECT_EQ(all_text(examine(good)), "");
  for (const Case& each : cases) {
    VehicleSnapshot bad = good;
    each.spoil(bad);
    const auto findings = examine(bad);
    ASSERT_EQ(findings.size(), 1u) << each.subject << "\n" << all_text(findings);
    EXPECT_EQ(findings[0].severity, each.severity) << to_text(findings[0]);
    EXPECT_EQ(findings[0].subject, each.subject);
    EXPECT_EQ(findings[0].found, each.found) << each.subject;
    EXPECT_THAT(findings[0].remedy, testing::HasSubstr(each.remedy));
    EXPECT_FALSE(findings[0].why.empty());
  }
}

std::function<void(VehicleSnapshot&)> set(const std::string& name, double value) {
  return [=](VehicleSnapshot& is) { is.parameters[name] = value; };
}

constexpr auto kNote = FindingSeverity::kNote, kWarning = FindingSeverity::kWarning,
               kError = FindingSeverity::kError;

TEST(Doctor, FindsEachFaultOfAnArduPilotAndNothingElse) {
  expect_each(
      healthy_ardupilot(),
      {
          {set("PLND_ENABLED", 0), kError, "PLND_ENABLED", "0", "set PLND_ENABLED to 1"},
          {[](auto& is) { is.parameters.clear(), is.absent = {"PLND_ENABLED"}; }, kError, "PLND_ENABLED",
           "missing", "load"},
          {set("PLND_TYPE", 2), kError, "PLND_TYPE", "2", "set PLND_TYPE to 1"},
          {set("PLND_ORIENT", 0), kError, "PLND_ORIENT", "0", "set PLND_ORIENT to 25"},
          {set("PLND_YAW_ALIGN", 9000), kError, "PLND_YAW_ALIGN", "9000", "to 0"},
          {set("PLND_CAM_POS_X", 0.1), kError, "PLND_CAM_POS_X", "0.1", "set PLND_CAM_POS_X to 0"},
          {set("PLND_CAM_POS_Y", -0.1), kError, "PLND_CAM_POS_Y", "-0.1", "set PLND_CAM_POS_Y to 0"},
          {set("PLND_CAM_POS_Z", 1), kError, "PLND_CAM_POS_Z", "1", "PLND_LAND_OFS"},
          {set("PLND_EST_TYPE", 0), kWarning, "PLND_EST_TYPE", "0", "to 1"},
          {set("PLND_LAND_OFS_X", 5), kNote, "PLND_LAND_OFS_X", "5", ""},
          {[](auto& is) { is.latency.reset(), is.parameters["PLND_LAG"] = 0.3; }, kWarning, "PLND_LAG", "0.3",
           "0.02..0.25"},
          {[](auto& is) { is.latency = 0.18; }, kWarning, "PLND_LAG", "0.06", "set PLND_LAG to 0.18"},
          {[](auto& is) { is.latency = 0.4; }, kWarning, "PLND_LAG", "0.06", "set PLND_LAG to 0.25"},
          {set("PLND_XY_DIST_MAX", 0), kWarning, "PLND_XY_DIST_MAX", "0", "to 2.5"},
          {set("PLND_XY_DIST_MAX", 0.1), kWarning, "PLND_XY_DIST_MAX", "0.1", "to 2.5"},
          {set("PLND_STRICT", 0), kWarning, "PLND_STRICT", "0", "to 1"},
          {set("PLND_RET_MAX", 0), kWarning, "PLND_RET_MAX", "0", "to 4"},
          {set("PLND_ALT_MIN", 9), kWarning, "PLND_ALT_MIN", "9", "to 0.75"},
          {set("PLND_OPTIONS", 5), kNote, "PLND_OPTIONS", "5", ""},
          {[](auto& is) {
             is.range_hz = 0, is.parameters["RNGFND1_TYPE"] = is.parameters["PLND_ALT_MAX"] = 0;
           },
           kWarning, "PLND_ALT_MIN", "0.75", "set PLND_ALT_MIN to 0"},
          {[](auto& is) {
             is.range_hz = 0, is.parameters["RNGFND1_TYPE"] = is.parameters["PLND_ALT_MIN"] = 0;
           },
           kWarning, "PLND_ALT_MAX", "8", "set PLND_ALT_MAX to 0"},
          {[](auto& is) { is.range_hz = is.parameters["PLND_ALT_MIN"] = is.parameters["PLND_ALT_MAX"] = 0; },
           kWarning, "RNGFND1_TYPE", "10", "wiring"},
          {[](auto& is) {
             is.range_hz = is.parameters["PLND_ALT_MIN"] = is.parameters["PLND_ALT_MAX"] = 0;
             is.parameters["RNGFND1_ORIENT"] = 0;
           },
           kWarning, "RNGFND1_ORIENT", "0", "to 25"},
      });
}

TEST(Doctor, FindsEachFaultOfALinkAndNothingElse) {
  expect_each(
      healthy_ardupilot(),
      {
          {[](auto& is) { is.heard = false; }, kError, "autopilot", "not heard", "baud rate"},
          {[](auto& is) { is.autopilot.autopilot = 20; }, kError, "autopilot", "MAV_AUTOPILOT 20", "profile"},
          {[](auto& is) { is.clock.reset(); }, kError, "TIMESYNC", "unanswered", "MAVLink 2"},
          {[](auto& is) { is.attitude_hz = 4; }, kError, "attitude rate", "4 Hz", "20 Hz"},
          {[](auto& is) { is.attitude_hz = 25; }, kWarning, "attitude rate", "25 Hz", "50 Hz"},
          {[](auto& is) { is.position_hz = 0; }, kWarning, "position rate", "0 Hz", "10 Hz"},
          {[](auto& is) { is.gimbal = true, is.gimbal_hz = 1; }, kWarning, "gimbal rate", "1 Hz", "20 Hz"},
          {[](auto& is) { is.gimbal = true; }, kError, "gimbal rate", "0 Hz", "20 Hz"},
          {[](auto& is) { is.lost_fraction = 0.2; }, kWarning, "lost frames", "20 %", "link"},
          {[](auto& is) { is.unread = {"PLND_TYPE"}; }, kWarning, "parameters", "not all read", "wait"},
          {[](auto& is) { is.autopilot.base_mode = 128; }, kNote, "vehicle", "armed", ""},
      });
}

TEST(Doctor, FindsEachFaultOfAPx4AndNothingElse) {
  expect_each(
      healthy_px4(),
      {
          {set("RTL_PLD_MD", 0), kWarning, "RTL_PLD_MD", "0", "set RTL_PLD_MD to 1"},
          {set("PLD_BTOUT", 0.5), kWarning, "PLD_BTOUT", "0.5", "to 5"},
          {set("PLD_HACC_RAD", 0.05), kWarning, "PLD_HACC_RAD", "0.05", "to 0.2"},
          {set("PLD_MAX_SRCH", 0), kWarning, "PLD_MAX_SRCH", "0", "to 3"},
          {set("LTEST_SENS_POS_X", 0.1), kWarning, "LTEST_SENS_POS_X", "0.1", "to 0"},
          {set("LTEST_SENS_ROT", 2), kWarning, "LTEST_SENS_ROT", "2", "to 0"},
          {set("VTE_EN", 1), kWarning, "VTE_EN", "1", "px4-vte"},
          {[](auto& is) { is.clock->min_round_trip_ns = 30'000'000; }, kWarning, "TIMESYNC round trip",
           "30 ms", "serial"},
          {[](auto& is) { is.position_hz = 5; }, kError, "position rate", "5 Hz", "10 Hz"},
          {[](auto& is) { is.odometry_hz = 0; }, kWarning, "ODOMETRY", "not received", "331"},
          {[](auto& is) { is.global_hz = 0; }, kWarning, "GLOBAL_POSITION_INT", "not received", "GNSS"},
          {[](auto& is) { is.asked_for_time = 0; }, kWarning, "TIMESYNC of PX4", "not asked", "Onboard"},
          {[](auto& is) { is.asked_for_time = 40; }, kNote, "TIMESYNC of PX4", "40 of 500 exchanges", ""},
      });
  expect_each(healthy_vte(), {
                                 {set("VTE_EN", 0), kWarning, "VTE_EN", "0", "set VTE_EN to 1"},
                                 {[](auto& is) { is.parameters.erase("VTE_EN"); }, kWarning, "VTE_EN",
                                  "missing", "profile px4"},
                                 {set("VTE_AID_MASK", 2), kError, "VTE_AID_MASK", "2", "add 4"},
                                 {set("VTE_EVP_NOISE", 0.1), kWarning, "VTE_EVP_NOISE", "0.1", "to 0.02"},
                                 {set("VTE_EVA_NOISE", 0.07), kNote, "VTE_EVA_NOISE", "0.07", ""},
                                 {set("VTE_EV_NOISE_MD", 1), kWarning, "VTE_EV_NOISE_MD", "1", "to 0"},
                             });
}

TEST(Doctor, SaysTheWorstFirstAndInOneLine) {
  VehicleSnapshot is = healthy_ardupilot();
  is.parameters["PLND_OPTIONS"] = 1;
  is.parameters["PLND_STRICT"] = 0;
  is.parameters["PLND_TYPE"] = 2;
  const auto findings = examine(is);
  ASSERT_EQ(findings.size(), 3u);
  EXPECT_EQ(to_text(findings[0]),
            "error: PLND_TYPE is 2: LANDING_TARGET is listened to with 1 (MAVLink) alone; set PLND_TYPE to 1 "
            "and reboot");
  EXPECT_THAT(to_text(findings[1]), testing::StartsWith("warning: PLND_STRICT is 0"));
  EXPECT_THAT(to_text(findings[2]), testing::StartsWith("note: PLND_OPTIONS is 1"));
}

TEST(Doctor, LooksAtALinkAndFindsWhatIsThere) {
  LinkedWorld world;
  world.autopilot.parameters = healthy_ardupilot().parameters;
  world.autopilot.parameters["PLND_CAM_POS_X"] = 0.25;
  world.autopilot.parameters.erase("PLND_ORIENT");  // as on an older firmware
  world.autopilot.motion = [](int64_t) {
    TrueMotion motion;
    motion.ned_from_body.translation.z() = -3;
    return motion;
  };
  VehicleSnapshot early = snapshot_of(world.link, LandingProfile::kArdupilot, world.now_ns);
  EXPECT_FALSE(early.heard);
  world.run(30);
  const VehicleSnapshot is = snapshot_of(world.link, LandingProfile::kArdupilot, world.now_ns);
  EXPECT_NEAR(is.attitude_hz, 100, 5);
  EXPECT_NEAR(is.range_hz, 10, 1);
  EXPECT_TRUE(is.absent.count("PLND_ORIENT"));
  EXPECT_TRUE(is.unread.empty());
  EXPECT_EQ(is.lost_fraction, 0);
  const auto findings = examine(is);
  ASSERT_EQ(findings.size(), 2u) << all_text(findings);
  EXPECT_EQ(findings[0].subject, "PLND_CAM_POS_X");
  EXPECT_EQ(findings[1].found, "armed");
}

}  // namespace
}  // namespace perch::mavlink
