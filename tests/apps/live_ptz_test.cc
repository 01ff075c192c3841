// perch-live and perch-visca-sim as a user starts them: a simulated flight seen through a head that turns.

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "support/child_program.h"
#include "support/estimates_table.h"
#include "support/free_port.h"
#include "support/run_program.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

const std::string kConfigs = std::string(PERCH_SOURCE_DIR) + "/configs";

std::string pinhole(double f) {
  const std::string focal = std::to_string(f);
  return "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [" + focal + ", " + focal +
         ", 159.5, 119.5], 'imagersize': [320, 240], 'extrinsics': [0, 0, 0, 0, 0, 0]}\n";
}

// A simulated EVI-D30 and a simulated camera that looks through it, in a folder.
struct Rig {
  explicit Rig(const std::string& zoom_ratio, const std::string& flight) {
    const std::string port = std::to_string(free_udp_port());
    device = std::make_unique<ChildProgram>(
        folder, PERCH_VISCA_SIM,
        std::vector<std::string>{"--pty", terminal(), "--truth", "udp://127.0.0.1:" + port});
    folder.write("sim.yaml",
                 "target: " + kConfigs +
                     "/targets/sharp.yaml\n"
                     "camera:\n  width: 320\n  height: 240\n  rate_hz: 15\n"
                     "  lens: LENSMODEL_PINHOLE\n  intrinsics: [352.7, 352.7, 159.5, 119.5]\n"
                     "  body_from_camera: {position: [0.1, 0, 0.05], rotation: {ypr_deg: [90, 0, 0]}}\n"
                     "  head: udp:127.0.0.1:" +
                     port + "\n  zoom_ratio: " + zoom_ratio + "\nflight: " + flight + "\n");
  }
  std::string terminal() const { return folder / "evi"; }
  // Its `ptz` section has the device already.
  void write_live(const std::string& ptz, const std::string& camera = "",
                  const std::string& more = "") const {
    folder.write("live.yaml", "target: " + kConfigs +
                                  "/targets/sharp.yaml\ncamera: {source: \"sim:sim.yaml\"" + camera +
                                  "}\nframes: {base_from_camera: {pan_tilt: {}}}\nptz: {device: " +
                                  "\"visca+serial:" + terminal() + ":9600\"" + ptz + "}\n" + more);
  }

  TempFolder folder, live_folder;
  std::unique_ptr<ChildProgram> device;
};

// Its lens is that of the zoom that the camera says it has: of the table's the widest.
TEST(LivePtz, FollowsThePadThroughASimulatedHead) {
  const Rig rig("1",
                "{start_height: 5, start_aside: 1, duration: 4, hover: 6, touchdown_height: 2.5, "
                "gust_attitude_deg: 2}");
  const TempFolder& folder = rig.folder;
  ASSERT_TRUE(rig.device->says("an EVI-D30 at", 30));
  folder.write("wide.cameramodel", pinhole(352.7));
  folder.write("tele.cameramodel", pinhole(900));
  folder.write("zoom.yaml",
               "models: [{zoom: 0, model: wide.cameramodel}, {zoom: 1, model: tele.cameramodel}]\n");
  rig.write_live("", ", zoom_table: zoom.yaml");
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

// 5 m over the pad it fills a quarter of the picture's height at the widest zoom; the poses tell that the
// lens of each picture's own zoom was used. And the recording gives them again.
TEST(LivePtz, ZoomsSoThatThePadFillsThePicture) {
  Rig rig("4",
          "{start_height: 5, start_aside: 0.3, duration: 1, touchdown_height: 5, hover: 12, "
          "gust_position: 0.05, gust_attitude_deg: 1}");
  ASSERT_TRUE(rig.device->says("an EVI-D30 at", 30));
  rig.folder.write("wide.cameramodel", pinhole(352.7));
  rig.folder.write("tele.cameramodel", pinhole(4 * 352.7));
  rig.folder.write("zoom.yaml",
                   "models: [{zoom: 0, model: wide.cameramodel}, {zoom: 1, model: tele.cameramodel}]\n");
  rig.write_live(", fill: 0.7", ", zoom_table: zoom.yaml", "outputs: {record: flights}\n");
  ChildProgram live(rig.live_folder, PERCH_LIVE,
                    {"--config", rig.folder / "live.yaml", "--summary", rig.folder / "summary.json",
                     "--output", rig.folder / "estimates"});
  ASSERT_EQ(live.wait(60), 0) << live.err();
  const auto json = nlohmann::json::parse(read_file(rig.folder / "summary.json"));
  EXPECT_GE(json["ptz"]["zoomed"], 1);
  EXPECT_LT(json["ptz"]["zoomed"], 15);
  EXPECT_GT(json["status"]["ok"], json["frames"].get<int>() / 2);
  // pad_from_body's height, with or without zoom.
  std::ifstream states(std::filesystem::path(rig.folder / "estimates") / "states.csv");
  std::string line;
  std::getline(states, line);
  int rows = 0, right = 0;
  while (std::getline(states, line)) {
    std::istringstream cells(line);
    std::string cell;
    for (int i = 0; i < 4; ++i) std::getline(cells, cell, ',');
    ++rows;
    right += std::abs(std::stod(cell) - 5) < 0.4;
  }
  EXPECT_GT(rows, 60);
  const std::filesystem::path flight = *std::filesystem::directory_iterator(rig.folder / "flights");
  const Outcome again = run_program_in(
      rig.folder, PERCH_BATCH,
      "--config " + (flight / "run/config.yaml").string() + " --output again " + flight.string());
  ASSERT_EQ(again.code, 0) << again.err;
  const std::filesystem::path output = rig.folder / "again" / flight.filename();
  EXPECT_EQ(without_times(lines_of(output / "estimates.csv")),
            without_times(lines_of(flight / "run/estimates.csv")));
  EXPECT_EQ(read_file(output / "states.csv"), read_file(flight / "run/states.csv"));
  EXPECT_GT(right, 0.95 * rows);
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
