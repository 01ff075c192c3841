// perch-calibrate-mount as a user calls it, on a flight that perch-simulate wrote and a test then broke.

#include <gmock/gmock.h>

#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "support/run_program.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using Fields = std::vector<std::string>;

// Small pictures of a wide lens and a vehicle that is thrown about: everything is told, coarsely.
constexpr char kSimulation[] =
    "camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [180, 180, 159.5, 119.5],"
    " rate_hz: 8}\n"
    "flight: {start_height: 4, start_aside: 0.6, touchdown_height: 2, duration: 9, hover: 0,"
    " yaw_drift_deg_per_s: 30, gust_position: 0.2, gust_attitude_deg: 5, gust_correlation: 1}\n"
    "nav: {rate_hz: 50}\n";
constexpr char kLimits[] =
    " --set calibrate_mount.limits.rotation_deg=2 --set calibrate_mount.limits.lever_arm=0.2"
    " --set calibrate_mount.limits.pad=1 --set calibrate_mount.limits.time_offset=0.05";

class PerchCalibrateMount : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = std::make_unique<TempFolder>();
    made_->write("landing.yaml",
                 "target: " + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml\n" + kSimulation);
    const Outcome made = run_program_in(*made_, PERCH_SIMULATE, "--config landing.yaml --output good");
    EXPECT_EQ(made.code, 0) << made.err;
  }
  static void TearDownTestSuite() { made_.reset(); }

  PerchCalibrateMount() {
    fs::copy(*made_ / "good", folder_ / "good", fs::copy_options::recursive);
    folder_.write("run.yaml", "target: " + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml\n");
  }
  Outcome run(const std::string& arguments) const {
    return run_program_in(folder_, PERCH_CALIBRATE_MOUNT, arguments);
  }
  Outcome calibrate() const {
    return run("--config run.yaml --output mount.yaml good" + std::string(kLimits));
  }

  // Each row of navigation: timestamp, p_x p_y p_z, q_w q_x q_y q_z, v.
  void edit_navigation(const std::function<void(Fields&)>& edit) const {
    const fs::path file = folder_ / "good/mav0/nav0/data.csv";
    std::istringstream in(read_file(file));
    std::ofstream out(file);
    for (std::string row; std::getline(in, row);) {
      Fields fields;
      std::istringstream parts(row);
      for (std::string field; std::getline(parts, field, ',');) fields.push_back(field);
      if (row[0] != '#') edit(fields);
      for (size_t i = 0; i < fields.size(); ++i) out << (i ? "," : "") << fields[i];
      out << '\n';
    }
  }
  void expect_refused(const std::string& why) const {
    const Outcome outcome = calibrate();
    EXPECT_EQ(outcome.code, 1) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_FALSE(fs::exists(folder_ / "mount.yaml"));
  }

  static std::unique_ptr<TempFolder> made_;
  TempFolder folder_;
};
std::unique_ptr<TempFolder> PerchCalibrateMount::made_;

TEST_F(PerchCalibrateMount, WritesAMountThatPerchBatchReads) {
  const Outcome outcome =
      run("--config run.yaml --output mount.yaml --json mount.json --report mount.html good" +
          std::string(kLimits));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("without a third of the pictures the mount is"));
  const auto json = nlohmann::json::parse(read_file(folder_ / "mount.json"));
  EXPECT_EQ(json["parameters"].size(), 13u);
  EXPECT_THAT(read_file(folder_ / "mount.html"), HasSubstr("Perch mount calibration"));

  folder_.write("batch.yaml", "target: " + std::string(PERCH_SOURCE_DIR) +
                                  "/configs/targets/sharp.yaml\nframes: !include mount.yaml\n");
  const Outcome batch = run_program_in(folder_, PERCH_BATCH, "--config batch.yaml --output out good");
  ASSERT_EQ(batch.code, 0) << batch.err;
  const auto summary = nlohmann::json::parse(read_file(folder_ / "out/good/summary.json"));
  EXPECT_EQ(summary["comparison"], "compared");
  // The pad's place was not in run.yaml: it comes from the calibration. Navigation is good to 2 cm.
  EXPECT_LT(summary["errors"]["position_m"]["rms"].get<double>(), 0.15);
  EXPECT_EQ(summary["attribution"]["causes"].size(), 6u);
}

TEST_F(PerchCalibrateMount, KnowsAQuaternionInTheWrongOrder) {
  edit_navigation([](Fields& f) { std::rotate(f.begin() + 4, f.begin() + 5, f.begin() + 8); });
  expect_refused("hold x y z w");
}

TEST_F(PerchCalibrateMount, KnowsAnotherFrame) {
  edit_navigation([](Fields& f) {
    std::swap(f[1], f[2]);
    f[3] = f[3][0] == '-' ? f[3].substr(1) : "-" + f[3];
  });
  expect_refused("one is ENU, one NED");
}

TEST_F(PerchCalibrateMount, SaysThatThereIsNoNavigation) {
  fs::remove_all(folder_ / "good/mav0/nav0");
  fs::remove_all(folder_ / "good/mav0/state_groundtruth_estimate0");  // serves as navigation else
  expect_refused("no navigation");
}

TEST_F(PerchCalibrateMount, SaysThatTheClocksHaveNoCommonTime) {
  edit_navigation([](Fields& f) { f[0] = std::to_string(std::stoll(f[0]) + 3'600'000'000'000); });
  expect_refused("no common time");
}

TEST_F(PerchCalibrateMount, SaysThatNothingMoved) {
  Fields first;
  edit_navigation([&](Fields& f) {
    if (first.empty()) first = f;
    std::copy(first.begin() + 1, first.end(), f.begin() + 1);
  });
  expect_refused("without motion");
}

TEST_F(PerchCalibrateMount, RefusesWhatTheFlightDoesNotTellAndTakesItFromAPrior) {
  const std::string strict =
      "--config run.yaml --output mount.yaml good --set calibrate_mount.limits.time_offset=1e-6"
      " --set calibrate_mount.limits.rotation_deg=2 --set calibrate_mount.limits.lever_arm=0.2"
      " --set calibrate_mount.limits.pad=1";
  const Outcome refused = run(strict);
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("time offset is known to"));
  EXPECT_FALSE(fs::exists(folder_ / "mount.yaml"));
  const Outcome told = run(strict +
                           " --set calibrate_mount.prior.time_offset.value=0"
                           " --set calibrate_mount.prior.time_offset.sigma=1e-7");
  EXPECT_EQ(told.code, 0) << told.err;
  EXPECT_TRUE(fs::exists(folder_ / "mount.yaml"));
}

TEST_F(PerchCalibrateMount, NamesWhatIsWrongWithTheCommandLineAndTheConfiguration) {
  EXPECT_EQ(run("good").code, 2);
  EXPECT_EQ(run("--config run.yaml good").code, 2);
  EXPECT_EQ(run("--config run.yaml --output m.yaml --pad both good").code, 2);
  EXPECT_THAT(run("--config run.yaml --output m.yaml good ./good/").err, HasSubstr("the same flight twice"));
  const Outcome unknown = run("--config run.yaml --output m.yaml --set calibrate_mount.lens=3 good");
  EXPECT_NE(unknown.code, 0);
  EXPECT_THAT(unknown.err, HasSubstr("calibrate_mount.lens"));
}

}  // namespace
}  // namespace perch
