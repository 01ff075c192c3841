#include "perch/estimator/run_config.h"

#include <gmock/gmock.h>

#include <string>

#include "support/config_error.h"

namespace perch {
namespace {

const std::filesystem::path kFolder = std::filesystem::path(PERCH_SOURCE_DIR) / "configs";

RunConfig read(const std::string& text) {
  return read_run_config(Section::parse(text, kFolder / "run.yaml"));
}

std::string complaint(const std::string& text) {
  return std::filesystem::path(config_error([&] { read(text); })).lexically_relative(kFolder);
}

TEST(RunConfig, NeedsNothingButATarget) {
  const RunConfig config = read("target: targets/sharp.yaml\n");
  EXPECT_EQ(config.target.name, "sharp");
  EXPECT_EQ(config.target.features.size(), 24u);
  EXPECT_TRUE(config.source.empty());
  EXPECT_TRUE(config.camera_model.empty());
  EXPECT_EQ(config.channel, Channel::kGrey);
  EXPECT_EQ(config.live.width, 0);
  EXPECT_FALSE(config.live.exposure);
  EXPECT_EQ(config.live.pace, Pace::kRealTime);
  EXPECT_EQ(config.detection.paper.threshold_fraction, 0.65);
  EXPECT_FALSE(config.frames.body_from_base);
  EXPECT_EQ(config.replay_aids, ReplayAids::kRecorded);
  EXPECT_TRUE(config.detection.follow);
}

TEST(RunConfig, ReadsEveryPartOfTheFile) {
  const RunConfig config = read(R"(
target: targets/sharp.yaml
camera: {source: "images:*.png", model: cam.cameramodel, channel: green, width: 640, height: 480, rate: 30,
         format: YUYV, exposure: 0.004, gain: 12, latency: 0.02, pace: fast}
frames: {body_from_base: identity}
detection: {method: paper, follow: false, paper: {threshold_fraction: 0.5, min_component_px: 7}}
pose: {max_rms_sigmas: 2}
tracking: {coast: 3, history: 0.2, fuse_navigation: true}
replay: {aids: navigation}
nav: mavlink+serial:/dev/ttyAMA0:921600
outputs: {station: {listen: "127.0.0.1:8080"}}
)");
  EXPECT_EQ(config.source, "images:" + (kFolder / "*.png").string());
  EXPECT_EQ(config.camera_model, kFolder / "cam.cameramodel");
  EXPECT_EQ(config.channel, Channel::kGreen);
  EXPECT_EQ(config.live.width, 640);
  EXPECT_EQ(config.live.height, 480);
  EXPECT_EQ(config.live.rate_hz, 30);
  EXPECT_EQ(config.live.format, "YUYV");
  EXPECT_EQ(config.live.exposure, 0.004);
  EXPECT_EQ(config.live.gain, 12);
  EXPECT_EQ(config.live.latency, 0.02);
  EXPECT_EQ(config.live.pace, Pace::kFast);
  EXPECT_TRUE(config.frames.body_from_base);
  EXPECT_EQ(config.detection.paper.threshold_fraction, 0.5);
  EXPECT_EQ(config.detection.paper.min_component_px, 7);
  EXPECT_FALSE(config.detection.follow);
  EXPECT_EQ(config.pose.max_rms_sigmas, 2);
  EXPECT_EQ(config.tracking.coast, 3);
  EXPECT_EQ(config.tracking.history, 0.2);
  EXPECT_TRUE(config.tracking.fuse_navigation);
  EXPECT_EQ(config.replay_aids, ReplayAids::kNavigation);
}

TEST(RunConfig, NamesTheLineAndTheKeyOfWhatIsWrong) {
  EXPECT_THAT(complaint("camera: {channel: green}\n"), testing::HasSubstr("target"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ncamera: {channel: infrared}\n"),
              testing::StartsWith("run.yaml:2: camera.channel: expected"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\n\ndetection: {paper: {threshold_fraction: 1.5}}\n"),
              testing::StartsWith("run.yaml:3: detection.paper.threshold_fraction: expected"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ndetection: {method: magic}\n"),
              testing::StartsWith("run.yaml:2: detection.method: expected"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ncamera: {width: 640}\n"),
              testing::StartsWith("run.yaml:2: camera.width: expected both width and height, or neither"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ncamera: {exposure: 4}\n"),
              testing::StartsWith("run.yaml:2: camera.exposure: expected"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ncamera: {exposure: auto}\n"),
              testing::StartsWith("run.yaml:2: camera.exposure: expected"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ncamera: {source: /dev/video0}\n"),
              testing::StartsWith("run.yaml:2: camera.source: expected a source, KIND:WHAT"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ndetection: {follow: 1}\n"),
              testing::StartsWith("run.yaml:2: detection.follow: expected"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ncamara: {}\n"),
              testing::StartsWith("run.yaml:2: camara"));
  EXPECT_THAT(complaint("target: targets/sharp.yaml\ndetection: {paper: {fraction: 0.5}}\n"),
              testing::StartsWith("run.yaml:2: detection.paper.fraction"));
}

}  // namespace
}  // namespace perch
