#include "perch/estimator/run_config.h"

namespace perch {

namespace {

void read_number(Section& section, std::string_view key, std::optional<double>& value, Range range) {
  if (!section.has(key)) return;
  double number = 0;
  section.read(key, number, range);
  value = number;
}

void read_live_options(Section& camera, LiveOptions& live) {
  camera.read("width", live.width, Range{0, 16384});
  camera.read("height", live.height, Range{0, 16384});
  if ((live.width == 0) != (live.height == 0)) {
    camera.fail(live.width == 0 ? "height" : "width", "both width and height, or neither");
  }
  camera.read("rate", live.rate_hz, Range{0, 1000});
  camera.read("format", live.format);
  read_number(camera, "exposure", live.exposure, Range{1e-6, 1});  // above: ms, not s
  read_number(camera, "gain", live.gain, kNotNegative);
  camera.read("latency", live.latency, Range{-1, 10});
  camera.read_choice("pace", live.pace, {{"real_time", Pace::kRealTime}, {"fast", Pace::kFast}});
}

}  // namespace

RunConfig read_run_config(Section root) {
  RunConfig config;
  if (!root.has("target")) root.fail("target", "the path of a target file");
  std::filesystem::path target;
  root.read("target", target);
  config.target = read_target(target);

  Section camera = root.section("camera");
  camera.read_source("source", config.source, {"video", "images", "flight", "sim"});
  if (camera.has("model")) camera.read("model", config.camera_model);
  if (camera.has("zoom_table")) {
    if (camera.has("model")) camera.fail("zoom_table", "either a model or a zoom_table");
    std::filesystem::path table;
    camera.read("zoom_table", table);
    config.zoom_table = read_zoom_table(table);
  }
  camera.read_choice("channel", config.channel,
                     {{"grey", Channel::kGrey},
                      {"red", Channel::kRed},
                      {"green", Channel::kGreen},
                      {"blue", Channel::kBlue}});
  read_live_options(camera, config.live);
  camera.done();

  config.frames = read_frame_chain(root.section("frames"));
  config.detection = read_detection_options(root.section("detection"));
  config.pose = read_pose_options(root.section("pose"));
  config.tracking = read_tracking_options(root.section("tracking"));
  Section replay = root.section("replay");
  replay.read_choice("aids", config.replay_aids,
                     {{"recorded", ReplayAids::kRecorded}, {"navigation", ReplayAids::kNavigation}});
  replay.done();
  // The live program's: a batch run reads the same file and leaves them alone.
  if (root.is_mapping_with("nav", "source")) {
    root.section("nav");
  } else {
    std::string nav = "flight";
    root.read("nav", nav);
  }
  root.section("outputs");
  root.section("ptz");
  root.section("calibrate_mount");  // perch-calibrate-mount's
  root.done();
  return config;
}

}  // namespace perch
