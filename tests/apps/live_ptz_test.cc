// perch-live and perch-visca-sim as a user starts them: a simulated flight seen through a head that turns.

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "support/child_program.h"
#include "support/run_program.h"
#include "support/temp_folder.h"
#include "support/udp_port.h"

namespace perch {
namespace {

const std::string kConfigs = std::string(PERCH_SOURCE_DIR) + "/configs";

std::string pinhole(double f) {
  const std::string focal = std::to_string(f);
  return "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [" + focal + ", " + focal +
         ", 159.5, 119.5], 'imagersize': [320, 240], 'extrinsics': [0, 0, 0, 0, 0, 0]}\n";
}

// Its lens is that of the zoom that the camera says it has: of the table's the widest.
TEST(LivePtz, FollowsThePadThroughASimulatedHead) {
  const TempFolder folder;
  const std::string terminal = folder / "evi", port = std::to_string(free_udp_port());
  ChildProgram device(folder, PERCH_VISCA_SIM, {"--pty", terminal, "--truth", "udp://127.0.0.1:" + port});
  ASSERT_TRUE(device.says("an EVI-D30 at", 30));
  folder.write("sim.yaml",
               "target: " + kConfigs +
                   "/targets/sharp.yaml\n"
                   "camera:\n  width: 320\n  height: 240\n  rate_hz: 15\n"
                   "  lens: LENSMODEL_PINHOLE\n  intrinsics: [352.7, 352.7, 159.5, 119.5]\n"
                   "  body_from_camera: {position: [0.1, 0, 0.05], rotation: {ypr_deg: [90, 0, 0]}}\n"
                   "  head: udp:127.0.0.1:" +
                   port +
                   "\nflight: {start_height: 5, start_aside: 1, duration: 4, hover: 0.5, "
                   "touchdown_height: 2.5, gust_attitude_deg: 2}\n");
  folder.write("wide.cameramodel", pinhole(352.7));
  folder.write("tele.cameramodel", pinhole(900));
  folder.write("zoom.yaml",
               "models: [{zoom: 0, model: wide.cameramodel}, {zoom: 1, model: tele.cameramodel}]\n");
  folder.write("live.yaml",
               "target: " + kConfigs +
                   "/targets/sharp.yaml\ncamera: {source: \"sim:sim.yaml\", zoom_table: zoom.yaml}\n"
                   "frames: {base_from_camera: {pan_tilt: {}}}\n"
                   "ptz: {device: \"visca+serial:" +
                   terminal + ":9600\"}\n");
  const std::filesystem::path summary = folder / "summary.json";
  TempFolder live_folder;
  ChildProgram live(live_folder, PERCH_LIVE, {"--config", folder / "live.yaml", "--summary", summary});
  ASSERT_EQ(live.wait(60), 0) << live.err();
  const auto json = nlohmann::json::parse(read_file(summary));
  EXPECT_TRUE(json["ptz"]["ready"]);
  EXPECT_GT(json["ptz"]["positions"], 30);
  EXPECT_GT(json["ptz"]["followed"], 20);
  EXPECT_GT(json["ptz"]["acks"], 5);
  // A machine that does other things leaves pictures out; most of those it takes have a pose.
  EXPECT_GT(json["status"]["ok"], json["frames"].get<int>() / 2);
}

TEST(LivePtz, AHeadNeedsTheFrameThatTurns) {
  const TempFolder folder;
  folder.write("live.yaml", "target: " + kConfigs +
                                "/targets/sharp.yaml\ncamera: {source: \"sim:" + kConfigs +
                                "/simulation/landing.yaml\"}\nptz: {device: \"visca+tcp://127.0.0.1:1\"}\n");
  TempFolder live_folder;
  ChildProgram live(live_folder, PERCH_LIVE, {"--config", folder / "live.yaml"});
  EXPECT_EQ(live.wait(20), 2);
  EXPECT_TRUE(live.says("base_from_camera: expected pan_tilt", 1)) << live.err();
}

TEST(LivePtz, AZoomTableNeedsSomebodyWhoTellsTheZoom) {
  const TempFolder folder;
  folder.write("wide.cameramodel", pinhole(300));
  folder.write("tele.cameramodel", pinhole(900));
  folder.write("zoom.yaml",
               "models: [{zoom: 0.1, model: wide.cameramodel}, {zoom: 1, model: tele.cameramodel}]\n");
  const std::string target = "target: " + kConfigs + "/targets/sharp.yaml\n";
  const std::string camera =
      "camera: {source: \"sim:" + kConfigs + "/simulation/landing.yaml\", zoom_table: zoom.yaml}\n";
  folder.write("nobody.yaml", target + camera);
  // Nobody has calibrated it at the widest zoom, to which `ptz` sends it where nothing is said.
  folder.write("beyond.yaml", target + camera +
                                  "frames: {base_from_camera: {pan_tilt: {}}}\n"
                                  "ptz: {device: \"visca+tcp://127.0.0.1:1\"}\n");
  for (const auto& [config, message] : {std::pair("nobody.yaml", "camera.zoom_table: expected ptz.device"),
                                        {"beyond.yaml", "ptz.zoom: expected one that"}}) {
    TempFolder live_folder;
    ChildProgram live(live_folder, PERCH_LIVE, {"--config", folder / config});
    EXPECT_EQ(live.wait(20), 2) << config;
    EXPECT_TRUE(live.says(message, 1)) << live.err();
  }
}

}  // namespace
}  // namespace perch
