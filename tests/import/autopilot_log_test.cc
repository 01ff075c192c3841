#include "perch/import/autopilot_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perch/geometry/so3.h"
#include "support/flight_logs.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kFloat = 6e-8;              // relative rounding of what logs store
constexpr double kPlace = 28 * kFloat;       // of three coordinates below 16 m
constexpr double kCentidegree = 0.00873e-2;  // half of one, rad

// Nose to the east, climbing to the right: headings, signs and axes all differ.
LoggedMoment circling(double t) {
  const YawPitchRoll ypr{0.4 * t - 1, 0.1 * std::sin(t), 0.2 * std::cos(0.7 * t)};
  const double yaw = 0.4, pitch = 0.1 * std::cos(t), roll = -0.14 * std::sin(0.7 * t);  // their rates
  LoggedMoment m;
  m.world_from_body = {rotation_from_ypr(ypr),
                       {10 * std::cos(0.3 * t), 10 * std::sin(0.3 * t), -5 - 0.5 * t}};
  m.velocity = {-3 * std::sin(0.3 * t), 3 * std::cos(0.3 * t), -0.5};
  // The textbook's Euler rate equation of the body's rates.
  m.gyro = {roll - yaw * std::sin(ypr.pitch),
            pitch * std::cos(ypr.roll) + yaw * std::sin(ypr.roll) * std::cos(ypr.pitch),
            -pitch * std::sin(ypr.roll) + yaw * std::cos(ypr.roll) * std::cos(ypr.pitch)};
  return m;
}

std::string error_of(const std::filesystem::path& file) {
  try {
    read_autopilot_log(file);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

// The flight again at every sample. `rad` and `m` are what the log's numbers allow.
void expect_circling(const AutopilotLog& log, int64_t start_ns, double rad, double m) {
  ASSERT_GT(log.nav.samples.size(), 100u);
  for (const NavSample& sample : log.nav.samples) {
    const LoggedMoment truth = circling(static_cast<double>(sample.timestamp_ns - start_ns) * 1e-9);
    ASSERT_LE(sample.world_from_body.rotation.angularDistance(truth.world_from_body.rotation), rad);
    ASSERT_LE((sample.world_from_body.translation - truth.world_from_body.translation).norm(), m);
    // Linear between samples 0.1 s apart: 3 m/s * 0.3^2 1/s^2 * 0.1^2 / 8.
    ASSERT_LE((sample.body_velocity_in_world - truth.velocity).norm(), 4e-4);
  }
  ASSERT_GT(log.gyro.size(), 1000u);
  for (const GyroSample& sample : log.gyro) {
    const LoggedMoment truth = circling(static_cast<double>(sample.timestamp_ns - start_ns) * 1e-9);
    ASSERT_LE((sample.angular_velocity_in_body - truth.gyro).norm(), 1e-6);
  }
  // The two agree with each other: attitude turns as the gyro says, first order in 40 ms.
  for (size_t i = 1; i < log.nav.samples.size(); ++i) {
    const NavSample &a = log.nav.samples[i - 1], &b = log.nav.samples[i];
    const double dt = static_cast<double>(b.timestamp_ns - a.timestamp_ns) * 1e-9;
    const Eigen::Vector3d turned =
        so3_log(a.world_from_body.rotation.conjugate() * b.world_from_body.rotation);
    const LoggedMoment middle =
        circling(static_cast<double>((a.timestamp_ns + b.timestamp_ns) / 2 - start_ns) * 1e-9);
    ASSERT_LE((turned / dt - middle.gyro).norm(), 2 * rad / dt + 1e-3);
  }
}

TEST(AutopilotLog, ReadsAUlogsMotion) {
  const TempFolder folder;
  const auto log = read_autopilot_log(folder.write("a.ulg", ulog_of(circling, 5, 25).bytes));
  EXPECT_EQ(log.kind, "PX4 ULog");
  EXPECT_THAT(log.problems, IsEmpty());
  EXPECT_EQ(log.attitude_from, "vehicle_attitude");
  EXPECT_EQ(log.gyro_from, "sensor_combined");
  EXPECT_FALSE(log.unix_minus_boot_ns);
  EXPECT_EQ(log.nav.samples.front().timestamp_ns, 5'000'000'000);
  // At the attitudes' 50 Hz. The cubic's error is 10 m * 0.3^4 * 0.1^4 / 384.
  EXPECT_EQ(log.nav.samples.size(), 20u * 50 + 1);
  expect_circling(log, 0, 4 * kFloat, kPlace);
}

TEST(AutopilotLog, ReadsADataflashLogsMotion) {
  const TempFolder folder;
  const auto log = read_autopilot_log(folder.write("a.bin", dataflash_of(circling, 5, 25).bytes));
  EXPECT_EQ(log.kind, "ArduPilot DataFlash");
  EXPECT_THAT(log.problems, IsEmpty());
  EXPECT_EQ(log.attitude_from, "XKF1");
  EXPECT_EQ(log.position_from, "XKF1");
  EXPECT_EQ(log.nav.samples.size(), 20u * 25 + 1);
  // Three angles rounded to centidegrees.
  expect_circling(log, 0, 1.8 * kCentidegree, kPlace);
}

// Level, nose to the east, and the body's own axes: what a mistaken order or sign of the quaternion, or a
// conjugate, would turn elsewhere.
TEST(AutopilotLog, KnownAttitudesTurnTheBodysAxesWhereTheyPoint) {
  struct Case {
    YawPitchRoll ypr;
    Eigen::Vector3d nose, right;  // in NED
  };
  const double h = M_PI / 2, s = std::sqrt(0.5);
  const Case cases[] = {{{h, 0, 0}, {0, 1, 0}, {-1, 0, 0}},           // nose to the east
                        {{0, M_PI / 4, 0}, {s, 0, -s}, {0, 1, 0}},    // nose up
                        {{0, 0, M_PI / 4}, {1, 0, 0}, {0, s, s}},     // right wing down
                        {{-h, 0, M_PI / 4}, {0, -1, 0}, {s, 0, s}}};  // to the west, right wing down
  for (const Case& c : cases) {
    const LoggedFlight still = [&](double) {
      LoggedMoment moment;
      moment.world_from_body.rotation = rotation_from_ypr(c.ypr);
      return moment;
    };
    const TempFolder folder;
    for (const auto& file : {folder.write("a.ulg", ulog_of(still, 1, 2).bytes),
                             folder.write("a.bin", dataflash_of(still, 1, 2).bytes)}) {
      const auto log = read_autopilot_log(file);
      for (const auto& sample : log.nav.samples) {
        const Eigen::Quaterniond& q = sample.world_from_body.rotation;
        ASSERT_LE((q * Eigen::Vector3d::UnitX() - c.nose).norm(), 2 * kCentidegree) << file;
        ASSERT_LE((q * Eigen::Vector3d::UnitY() - c.right).norm(), 2 * kCentidegree) << file;
      }
    }
  }
}

TEST(AutopilotLog, TakesTheTimeOfDayFromGps) {
  const TempFolder folder;
  constexpr uint64_t kStart = 1'700'000'000'123'456;  // us
  const auto px4 = read_autopilot_log(folder.write("a.ulg", ulog_of(circling, 5, 10, kStart).bytes));
  ASSERT_TRUE(px4.unix_minus_boot_ns);
  EXPECT_EQ(*px4.unix_minus_boot_ns, 1'700'000'000'123'456'000);
  expect_circling(px4, *px4.unix_minus_boot_ns, 4 * kFloat, kPlace);
  // `date -d @1700000000` is Tuesday 14 November 2023, 22:13:20 UTC: GPS week 2288, and 18 leap seconds.
  const auto ms = static_cast<uint32_t>((2 * 86400 + 22 * 3600 + 13 * 60 + 20 + 18) * 1000);
  const auto ardupilot =
      read_autopilot_log(folder.write("a.bin", dataflash_of(circling, 5, 10, 2288, ms).bytes));
  ASSERT_TRUE(ardupilot.unix_minus_boot_ns);
  EXPECT_EQ(*ardupilot.unix_minus_boot_ns, 1'700'000'000'000'000'000);
}

TEST(AutopilotLog, OlderDataflashLogsHavePositionsInDegrees) {
  DataflashWriter w;
  w.format(10, "ATT", "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw");
  w.format(14, "POS", "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt");
  for (int i = 0; i <= 20; ++i) {
    const auto us = static_cast<uint64_t>(i) * 100'000;
    w.row(10, us, int16_t{0}, int16_t{0}, int16_t{0}, int16_t{0}, uint16_t{0}, uint16_t{9000});
    // 1e-5 degrees north and twice that east each 0.1 s, from Zurich's latitude, and climbing.
    w.row(14, us, int32_t{474000000 + 100 * i}, int32_t{85000000 + 200 * i}, 500.0F + static_cast<float>(i),
          0.0F, 0.0F);
  }
  const TempFolder folder;
  const auto log = read_autopilot_log(folder.write("a.bin", w.bytes));
  EXPECT_EQ(log.position_from, "POS");
  EXPECT_THAT(log.gyro, IsEmpty());
  ASSERT_EQ(log.nav.samples.size(), 21u);
  // A degree there is 111.18 km to the north and 75.5 km to the east.
  const NavSample& last = log.nav.samples.back();
  EXPECT_NEAR(last.world_from_body.translation.x(), 20e-5 * 111180, 0.01);
  EXPECT_NEAR(last.world_from_body.translation.y(), 40e-5 * 75500, 0.03);
  EXPECT_NEAR(last.world_from_body.translation.z(), -20, 1e-6);
  EXPECT_NEAR(last.body_velocity_in_world.z(), -10, 1e-6);
  EXPECT_NEAR(ypr_from_rotation(last.world_from_body.rotation).yaw, M_PI / 2, kCentidegree);
}

TEST(AutopilotLog, SaysWhatIsMissingAndWhatIsThere) {
  const TempFolder folder;
  UlogWriter w;
  w.format("battery_status", "uint64_t timestamp;float voltage_v;");
  w.subscribe(1, "battery_status");
  w.row(1, uint64_t{1000}, 16.8F);
  EXPECT_THAT(error_of(folder.write("a.ulg", w.bytes)),
              AllOf(HasSubstr("a.ulg: no attitude: expected vehicle_attitude, found battery_status")));
  DataflashWriter d;
  d.format(9, "BAT", "Qf", "TimeUS,Volt");
  d.row(9, uint64_t{1000}, 16.8F);
  EXPECT_THAT(error_of(folder.write("a.bin", d.bytes)),
              HasSubstr("a.bin: no attitude: expected ATT, XKF1 or NKF1, found BAT"));
  EXPECT_THAT(error_of(folder.write("a.txt", "hello")),
              HasSubstr("a.txt: neither a PX4 ULog nor an ArduPilot DataFlash log"));
  EXPECT_THAT(error_of(folder.write("a.empty", "")), HasSubstr("a.empty: neither"));
  EXPECT_THAT(error_of(folder / "none"), HasSubstr("none: cannot be read"));
}

TEST(AutopilotLog, InvalidPositionsAreLeftOutAndCounted) {
  const TempFolder folder;
  UlogWriter w = ulog_of(circling, 5, 10);
  w.row(4, uint64_t{10'050'000}, uint64_t{10'050'000}, 1e6F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, uint8_t{0},
        uint8_t{1}, uint8_t{1}, uint8_t{1});
  const auto log = read_autopilot_log(folder.write("a.ulg", w.bytes));
  EXPECT_THAT(log.problems,
              ElementsAre(HasSubstr("vehicle_local_position: 1 of 52 positions that the autopilot "
                                    "calls invalid, skipped")));
  expect_circling(log, 0, 4 * kFloat, kPlace);
}

}  // namespace
}  // namespace perch
