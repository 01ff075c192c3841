// perch-import as a user calls it, up to what perch-batch makes of the flight.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "perch/config/section.h"
#include "perch/flight/flight.h"
#include "perch/geometry/so3.h"
#include "perch/simulation/simulation.h"
#include "support/bag_writer.h"
#include "support/flight_logs.h"
#include "support/run_program.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// Small pictures of a pad in gusts; the autopilot was switched on 100 s before.
constexpr char kSimulation[] =
    "camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5],"
    " rate_hz: 15}\n"
    "flight: {start_height: 4, start_aside: 1, touchdown_height: 1.5, duration: 7, hover: 1, gust_position: "
    "0.1,"
    " gust_attitude_deg: 1.5}\n"
    "nav: {rate_hz: 50}\n";
constexpr double kBoot = 100;

class PerchImport : public testing::Test {
 protected:
  // One flight for all: pictures take their time.
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    folder_->write("landing.yaml", "target: " + std::string(PERCH_SOURCE_DIR) +
                                       "/configs/targets/sharp.yaml\n" + kSimulation);
    const Outcome made = run_program_in(*folder_, PERCH_SIMULATE, "--config landing.yaml --output good");
    ASSERT_EQ(made.code, 0) << made.err;
    flight_ = new SimulatedFlight(read_simulation(Section::load(*folder_ / "landing.yaml")));
    // As a camera without a clock would have it: the pictures alone, at a time that counts from elsewhere.
    fs::create_directories(*folder_ / "blind/mav0");
    fs::copy(*folder_ / "good/mav0/cam0", *folder_ / "blind/mav0/cam0", fs::copy_options::recursive);
    folder_->write("camera.yaml", read_file(*folder_ / "good/mav0/cam0/sensor.yaml"));
    folder_->write("a.ulg", ulog_of(logged, kBoot - 20, kBoot + 20).bytes);
    folder_->write("a.bin", dataflash_of(logged, kBoot - 20, kBoot + 20).bytes);
  }
  static void TearDownTestSuite() {
    delete flight_;
    delete folder_;
  }

  // By the autopilot's clock.
  static LoggedMoment logged(double t) {
    constexpr double h = 1e-4;
    const auto at = [](double time) { return flight_->vehicle_at(time - kBoot); };
    LoggedMoment moment{at(t).world_from_body, at(t).body_velocity_in_world, {}};
    moment.gyro =
        so3_log(at(t - h).world_from_body.rotation.conjugate() * at(t + h).world_from_body.rotation) /
        (2 * h);
    return moment;
  }
  // The pictures' clock minus the autopilot's, s.
  static double true_offset() { return static_cast<double>(flight_->timestamp_ns(0)) * 1e-9 - kBoot; }

  static Outcome import(const std::string& arguments) {
    return run_program_in(*folder_, PERCH_IMPORT, arguments);
  }
  static json facts(const std::string& flight) {
    return json::parse(read_file(*folder_ / flight / "import.json"));
  }
  // perch-batch's summary of a flight, estimated with the true frames.
  static json batch(const std::string& flight) {
    const Outcome result =
        run_program_in(*folder_, PERCH_BATCH, "--config good/perch.yaml --notimes --output out " + flight);
    EXPECT_EQ(result.code, 0) << result.err;
    return json::parse(read_file(*folder_ / "out" / flight / "summary.json"));
  }
  // Navigation in this log is the truth, so vision's own error is all that is left, and the clocks'.
  static void expect_good(const json& summary) {
    EXPECT_EQ(summary["problems"].size(), 0u) << summary["problems"];
    EXPECT_EQ(summary["detection"]["counts"]["ok"], flight_->frames());
    EXPECT_EQ(summary["compared_frames"], flight_->frames());
    EXPECT_LT(summary["errors"]["position_m"]["rms"], 0.02);  // m
  }

  static TempFolder* folder_;
  static SimulatedFlight* flight_;
};
TempFolder* PerchImport::folder_ = nullptr;
SimulatedFlight* PerchImport::flight_ = nullptr;

TEST_F(PerchImport, AlignsAUlogWithPicturesByTheirTarget) {
  const Outcome result = import("--output px4 --config good/perch.yaml blind a.ulg");
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("a.ulg: PX4 ULog, "), HasSubstr("100 % of it by the target")));
  const json found = facts("px4");
  const double off = found["offset_ns"].get<double>() * 1e-9 - true_offset();
  EXPECT_LT(std::abs(off), 0.005) << result.out;
  EXPECT_LT(std::abs(off), 4 * found["offset_sigma_s"].get<double>()) << result.out;
  EXPECT_LT(found["offset_sigma_s"], 0.005);
  expect_good(batch("px4"));
  // Links, not copies.
  const auto picture = fs::directory_iterator(*folder_ / "px4/mav0/cam0/data")->path();
  EXPECT_TRUE(fs::equivalent(picture, *folder_ / "blind/mav0/cam0/data" / picture.filename()));
}

TEST_F(PerchImport, AlignsByTracksWhereNoTargetIsKnown) {
  const Outcome result = import("--output tracks blind a.ulg");
  ASSERT_EQ(result.code, 0) << result.err;
  const json found = facts("tracks");
  const double off = found["offset_ns"].get<double>() * 1e-9 - true_offset();
  EXPECT_LT(std::abs(off), 3 * found["offset_sigma_s"].get<double>()) << result.out;
  EXPECT_LT(std::abs(off), 0.02) << result.out;
  EXPECT_EQ(found["turns_by_target"], 0);
  EXPECT_GT(found["offset_sigma_s"], 0.001);  // several times what the target gives
}

TEST_F(PerchImport, AVideoWithTimesAndADataflashLog) {
  // 0.37 s ahead of the pictures' own clock.
  std::string times = "timestamp [ns]\n";
  cv::VideoWriter video((*folder_ / "v.avi").string(), cv::VideoWriter::fourcc('F', 'F', 'V', '1'), 15,
                        {320, 240}, false);
  for (int64_t i = 0; i < flight_->frames(); ++i) {
    times += std::to_string(flight_->timestamp_ns(i) + 370'000'000) + "\n";
    video.write(cv::imread(
        (*folder_ / "good/mav0/cam0/data" / (std::to_string(flight_->timestamp_ns(i)) + ".png")).string(),
        cv::IMREAD_GRAYSCALE));
  }
  video.release();
  folder_->write("times.csv", times);
  const Outcome result =
      import("--output ardu --config good/perch.yaml --times times.csv --camera camera.yaml v.avi a.bin");
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NEAR(facts("ardu")["offset_ns"].get<double>() * 1e-9 - true_offset(), 0.37, 0.005) << result.out;
  expect_good(batch("ardu"));
  EXPECT_TRUE(fs::equivalent(*folder_ / "v.avi", *folder_ / "ardu/mav0/cam0/data.mkv"));

  // The same offset told; and a copy.
  char told[40];
  std::snprintf(told, sizeof told, "%.9f", true_offset() + 0.37);
  ASSERT_EQ(import("--output told --copy --times times.csv --camera camera.yaml v.avi a.bin --offset " +
                   std::string(told))
                .code,
            0);
  expect_good(batch("told"));
  EXPECT_FALSE(fs::equivalent(*folder_ / "v.avi", *folder_ / "told/mav0/cam0/data.mkv"));

  // Without a log and without times there is a flight that can be estimated, if not scored.
  ASSERT_EQ(import("--output alone --camera camera.yaml v.avi").code, 0);
  const json alone = batch("alone");
  EXPECT_EQ(alone["detection"]["counts"]["ok"], flight_->frames());

  folder_->write("short.csv", times.substr(0, times.size() / 2) + "\n");
  const Outcome refused = import("--output none --times short.csv --camera camera.yaml v.avi");
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("which frame a time is of is not known"));
  EXPECT_FALSE(fs::exists(*folder_ / "none"));
  EXPECT_FALSE(fs::exists(*folder_ / "none.part"));
}

TEST_F(PerchImport, ABagGivesTheSameEstimatesAsItsPicturesDid) {
  {
    BagWriter bag(*folder_ / "a.bag");
    bag.camera_info("/cam/camera_info", flight_->timestamp_ns(0), {320, 240}, {226, 226, 159.5, 119.5}, {},
                    "plumb_bob");
    for (int64_t i = 0; i < flight_->frames(); ++i) {
      const auto file =
          *folder_ / "good/mav0/cam0/data" / (std::to_string(flight_->timestamp_ns(i)) + ".png");
      bag.image("/cam/image_raw", flight_->timestamp_ns(i), cv::imread(file.string(), cv::IMREAD_GRAYSCALE),
                "mono8");
    }
    for (const auto& sample : read_flight(*folder_ / "good").nav.samples) bag.odometry("/odom", sample);
    bag.close();
  }
  const Outcome result = import("--output ros a.bag");
  ASSERT_EQ(result.code, 0) << result.err;
  const json good = batch("good"), ros = batch("ros");
  EXPECT_EQ(read_file(*folder_ / "out/ros/estimates.csv"), read_file(*folder_ / "out/good/estimates.csv"));
  EXPECT_EQ(ros["compared_frames"], flight_->frames());
  EXPECT_NEAR(ros["errors"]["position_m"]["rms"], good["errors"]["position_m"]["rms"], 1e-9);
  const Outcome missing = import("--output none --topic /gps a.bag");
  EXPECT_EQ(missing.code, 1);
  EXPECT_THAT(missing.err,
              AllOf(HasSubstr("a.bag: no topic /gps, found "), HasSubstr("/odom (nav_msgs/Odometry)"),
                    HasSubstr("/cam/image_raw (sensor_msgs/Image)")));
}

TEST_F(PerchImport, ATruncatedLogServesAsFarAsItGoes) {
  const std::string log = read_file(*folder_ / "a.ulg");
  // 40 s, of which the pictures begin after 20: three quarters end at 10 s after them, half amid nothing.
  folder_->write("cut.ulg", log.substr(0, log.size() * 6 / 8 + 5));
  const Outcome result = import("--output cut --config good/perch.yaml blind cut.ulg");
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("cut.ulg: "));
  EXPECT_THAT(facts("cut")["problems"].dump(), HasSubstr("bytes that are no messages"));
  folder_->write("short.ulg", log.substr(0, log.size() / 30));
  const Outcome refused = import("--output none --config good/perch.yaml blind short.ulg");
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("perch-import: blind: the log is too short"));
}

TEST_F(PerchImport, RefusesALogOfAnotherFlightAndAnOffsetThatMisses) {
  Simulation other = flight_->simulation();
  other.seed = 77;
  const SimulatedFlight elsewhere(other);
  const LoggedFlight fly = [&](double t) {
    constexpr double h = 1e-4;
    const auto at = [&](double time) { return elsewhere.vehicle_at(time - kBoot); };
    return LoggedMoment{
        at(t).world_from_body, at(t).body_velocity_in_world,
        so3_log(at(t - h).world_from_body.rotation.conjugate() * at(t + h).world_from_body.rotation) /
            (2 * h)};
  };
  folder_->write("other.ulg", ulog_of(fly, kBoot - 20, kBoot + 20).bytes);
  const Outcome refused = import("--output none --config good/perch.yaml blind other.ulg");
  EXPECT_EQ(refused.code, 1) << refused.out;
  EXPECT_THAT(refused.err, HasSubstr("do not decide on an offset"));
  const Outcome missed = import("--output none --offset 5 blind a.ulg");
  EXPECT_EQ(missed.code, 1);
  EXPECT_THAT(missed.err, HasSubstr("no time in common: pictures from "));
  EXPECT_FALSE(fs::exists(*folder_ / "none"));
  EXPECT_FALSE(fs::exists(*folder_ / "none.part"));
}

TEST_F(PerchImport, BadUsageIsExitCode2AndWritesNothing) {
  folder_->write("text.txt", "hello");
  folder_->write("broken.yaml", "lensmodel: [");
  for (const char* arguments :
       {"", "blind", "--output none", "--output none nothing", "--output none a.ulg",
        "--output none blind blind", "--output none blind a.ulg a.bin",
        "--output none --offset x blind a.ulg", "--output none --offset 1 blind",
        "--output none --times times.csv blind", "--output none --topic /a blind",
        "--output none --camera none.yaml blind", "--output none --camera broken.yaml blind",
        "--output none --config none.yaml blind a.ulg", "--output good blind"}) {
    const Outcome result = import(arguments);
    EXPECT_EQ(result.code, 2) << arguments;
    EXPECT_THAT(result.err, testing::StartsWith("perch-import: ")) << arguments;
    EXPECT_FALSE(fs::exists(*folder_ / "none")) << arguments;
    EXPECT_FALSE(fs::exists(*folder_ / "none.part")) << arguments;
  }
  const Outcome text = import("--output none text.txt");
  EXPECT_EQ(text.code, 1);
  EXPECT_THAT(text.err, HasSubstr("text.txt: no video that can be decoded"));
}

}  // namespace
}  // namespace perch
