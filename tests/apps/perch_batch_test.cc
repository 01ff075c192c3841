// perch-batch as a user calls it, on flights that perch-simulate wrote and a test then broke.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "support/run_program.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

// Small pictures, from near: every one shows the whole target.
constexpr char kSimulation[] =
    "camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5],"
    " rate_hz: 10}\n"
    "flight: {start_height: 4, start_aside: 0.5, touchdown_height: 2, duration: 1.1, hover: 0}\n";
constexpr size_t kFrames = 12;

class PerchBatch : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    flown_ = std::make_unique<TempFolder>();
    flown_->write("landing.yaml",
                  "target: " + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml\n" + kSimulation);
    const Outcome made = run_program_in(*flown_, PERCH_SIMULATE, "--config landing.yaml --output good");
    EXPECT_EQ(made.code, 0) << made.err;
  }
  static void TearDownTestSuite() { flown_.reset(); }

  PerchBatch() { fs::copy(*flown_ / "good", folder_ / "good", fs::copy_options::recursive); }
  Outcome run(const std::string& arguments) const { return run_program_in(folder_, PERCH_BATCH, arguments); }
  Outcome run_flights(const std::string& flights) const {
    return run("--config good/perch.yaml --output out " + flights);
  }
  fs::path copy(const std::string& name) const {
    fs::copy(folder_ / "good", folder_ / name, fs::copy_options::recursive);
    return folder_ / name / "mav0" / "cam0";
  }
  std::vector<fs::path> pictures(const std::string& flight) const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder_ / flight / "mav0/cam0/data"))
      files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
  }
  json summary(const std::string& flight) const {
    return json::parse(read_file(folder_ / "out" / flight / "summary.json"));
  }
  static inline std::unique_ptr<TempFolder> flown_;
  TempFolder folder_;
};

TEST_F(PerchBatch, ScoresAFlightAndWritesAllItsFiles) {
  const Outcome result = run_flights("good");
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.out,
              HasSubstr("good: 12 of 12 frames with a pose (100.0 %), 12 compared with navigation"));
  EXPECT_THAT(result.out, HasSubstr("report: out/report.html\n"));
  for (const char* file : {"good/estimates.csv", "good/states.csv", "good/pad_from_body.tum",
                           "good/errors.csv", "good/summary.json", "good/report.html", "summary.csv",
                           "report.html", "report.js", "results.sqlite"}) {
    EXPECT_TRUE(fs::exists(folder_ / "out" / file)) << file;
  }
  // The simulator's truth: a hundredth of the distance is what 320 x 240 gives at the very worst.
  EXPECT_LT(summary("good")["truth"]["position_over_range_rms"], 0.01);
}

TEST_F(PerchBatch, BrokenPicturesCostThemselvesOnly) {
  copy("broken");
  const auto files = pictures("broken");
  ASSERT_EQ(files.size(), kFrames);
  const std::string whole = read_file(files[3]);
  const cv::Mat grey = cv::imread(files[4].string(), cv::IMREAD_GRAYSCALE);
  fs::remove(files[1]);
  folder_.write(files[2], "");
  folder_.write(files[3], whole.substr(0, whole.size() / 2));
  cv::imwrite(files[4].string(), grey(cv::Rect(0, 0, 200, 100)));
  cv::Mat deep, colour;
  grey.convertTo(deep, CV_16U, 256);
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  cv::imwrite(files[5].string(), deep);  // 16 bits and colours are pictures
  cv::imwrite(files[6].string(), colour);

  const Outcome result = run_flights("broken good");
  EXPECT_EQ(result.code, 0) << result.err;
  const json broken = summary("broken");
  EXPECT_EQ(broken["frames"], kFrames);
  EXPECT_EQ(broken["detection"]["counts"]["unreadable"], 4);
  EXPECT_EQ(broken["detection"]["counts"]["ok"], kFrames - 4);
  const std::vector<std::string> problems = broken["problems"];
  ASSERT_EQ(problems.size(), 4u);
  const auto expect_problem = [&](size_t picture, const std::string& cause) {
    const std::string file = files[picture].filename().string();
    EXPECT_THAT(problems, testing::Contains(testing::AllOf(HasSubstr(file + ": "), HasSubstr(cause))))
        << cause;
  };
  expect_problem(1, "no such file");
  expect_problem(2, "empty");
  expect_problem(3, "truncated");
  expect_problem(4, "expected a picture of the camera model's 320x240 pixels, found 200x100");
  EXPECT_EQ(summary("good")["problems"].size(), 0u);
}

TEST_F(PerchBatch, AFlightThatCannotBeEstimatedIsCountedAndTheRestDone) {
  fs::remove(copy("blind") / "sensor.yaml");
  const Outcome result = run_flights("blind good none");
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.err, HasSubstr("perch-batch: none: no flight: expected mav0/cam0/data.csv in it\n"));
  EXPECT_THAT(result.err, HasSubstr("perch-batch: blind: no camera model: "));
  EXPECT_EQ(summary("good")["detection"]["counts"]["ok"], kFrames);
  const std::string csv = read_file(folder_ / "out/summary.csv");
  EXPECT_THAT(csv, HasSubstr("\nblind,not estimated,0,0,"));
  EXPECT_THAT(csv, HasSubstr("\ngood,compared,12,12,1,12,"));
  EXPECT_THAT(csv, HasSubstr("\nnone,not estimated,0,0,"));
  EXPECT_THAT(read_file(folder_ / "out/report.html"), HasSubstr("no camera model: "));
}

TEST_F(PerchBatch, APanTiltHeadWithoutAnglesIsSaid) {
  const Outcome result =
      run("--config good/perch.yaml --output out --set "
          "'frames.base_from_camera={pan_tilt: {base_from_zero: identity}}' good");
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(summary("good")["detection"]["counts"]["ok"], kFrames);
  const std::string tum = read_file(folder_ / "out/good/pad_from_body.tum");
  EXPECT_EQ(std::count(tum.begin(), tum.end(), '\n'), std::count(tum.begin(), tum.end(), '#'));
  const std::vector<std::string> problems = summary("good")["problems"];
  EXPECT_THAT(problems, testing::ElementsAre(HasSubstr("good/mav0/gimbal0/data.csv: no angles of the "
                                                       "pan/tilt head at 12 of 12 frames")));
}

TEST_F(PerchBatch, ComparesWithAnEarlierRun) {
  ASSERT_EQ(run("--config good/perch.yaml --set detection.method=paper --output before good").code, 0);
  const Outcome result = run("--config good/perch.yaml --output out --compare before good");
  EXPECT_EQ(result.code, 0) << result.err;
  const std::string changes = result.out.substr(result.out.find("A: before, B: out, 1 flights, 12 frames"));
  for (const char* line : {"  B finds ", "  position RMS ", "  attitude RMS ", "  time a frame ", "  good:\n",
                           "    with a pose ", "    yaw RMS ", "    position RMS, truth ", "    mean NEES ",
                           "    median time a frame "}) {
    EXPECT_THAT(changes, HasSubstr(line));
  }
  EXPECT_THAT(changes, Not(HasSubstr("nan")));
  // The same of two runs that are there; the other way round the better method has become the worse one.
  const Outcome back = run("--compare out before");
  EXPECT_EQ(back.code, 3) << back.out << back.err;
  EXPECT_THAT(back.out, HasSubstr(" higher ["));
  EXPECT_THAT(back.out, HasSubstr("]: worse\n"));
}

TEST_F(PerchBatch, AnInterruptLeavesWholeFilesOnly) {
  // Far more frames than are decoded ahead, so that the signal comes amid a flight: the same pictures over
  // and over.
  constexpr int kRows = 600;
  const fs::path rows = copy("long") / "data.csv";
  const auto files = pictures("long");
  std::string csv;
  for (int i = 0; i < kRows; ++i) {
    csv += std::to_string(i * 1'000'000) + "," +
           files[static_cast<size_t>(i) % files.size()].filename().string() + "\n";
  }
  folder_.write(rows, csv);
  std::string flights;
  for (int i = 0; i < 40; ++i) {
    const std::string name = "f" + std::to_string(i);
    fs::create_directory_symlink(folder_ / "long", folder_ / name);
    flights += ' ' + name;
  }
  const pid_t child = fork();
  if (child == 0) {
    const std::string command = std::string("exec ") + PERCH_BATCH +
                                " --config good/perch.yaml --output out --jobs 2" + flights + " >.out 2>.err";
    if (chdir(folder_.path().c_str()) == 0) execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  for (int i = 0; i < 2000 && !fs::exists(folder_ / "out/f0/summary.json"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  kill(child, SIGINT);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_THAT(read_file(folder_ / ".err"), HasSubstr("perch-batch: interrupted: "));
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html"));
  size_t done = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "out")) {
    if (entry.is_directory()) continue;
    EXPECT_THAT(entry.path().filename().string(),
                testing::AnyOf("estimates.csv", "states.csv", "pad_from_body.tum", "errors.csv",
                               "summary.json", "complete.json", "summary.csv", "report.html", "report.js",
                               "results.sqlite", ".lock"));
    if (entry.path().filename() != "estimates.csv") continue;
    ++done;
    const std::string text = read_file(entry.path());
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), kRows + 1);
  }
  EXPECT_GE(done, 1u);
  EXPECT_LT(done, 40u);
}

TEST_F(PerchBatch, BadUsageIsExitCode2AndWritesNothing) {
  for (const char* arguments :
       {"", "--output out good", "--config good/perch.yaml good", "--config good/perch.yaml --output out",
        "--config none.yaml --output out good", "--config good/perch.yaml --output out --shard 2/1 good",
        "--config good/perch.yaml --output out --jobs -1 good",
        "--config good/perch.yaml --output out --compare none good",
        "--config good/perch.yaml --output out --set detection.method=magic good",
        "--config good/perch.yaml --output out --manifest none",
        "--config good/perch.yaml --output out good good"}) {
    const Outcome result = run(arguments);
    EXPECT_EQ(result.code, 2) << arguments;
    EXPECT_EQ(result.out, "") << arguments;
    EXPECT_THAT(result.err, testing::StartsWith("perch-batch: ")) << arguments;
    EXPECT_FALSE(fs::exists(folder_ / "out")) << arguments;
  }
}

}  // namespace
}  // namespace perch
