#include "live_config.h"

#include "perch/config/error.h"

namespace perch {
namespace {

constexpr std::string_view kMavlinkPrefix = "mavlink+";

void read_nav(Section& root, LiveConfig& config) {
  std::string nav = is_replay(config) ? "flight" : "none";
  root.read("nav", nav);
  if (nav == "none") return;
  config.nav = NavSource::kFlight;
  if (nav == "flight") {
    // A camera that runs has no recording of an autopilot beside it.
    if (!is_replay(config)) root.fail("nav", "none or mavlink+URL, as camera.source is no flight");
    return;
  }
  if (!nav.starts_with(kMavlinkPrefix)) root.fail("nav", "none, flight or mavlink+URL");
  try {
    const StreamUrl url = parse_stream_url(nav);
    if (is_replay(config)) return;
    config.nav = NavSource::kMavlink;
    config.autopilot = url;
  } catch (const ConfigError& e) {
    root.fail("nav", std::string("mavlink+ and the URL of a byte stream (") + e.what() + ")");
  }
}

// A folder; or the folder and how pictures are written.
void read_record(Section& outputs, LiveConfig& config) {
  if (!outputs.is_mapping_with("record", "folder")) {
    if (outputs.has("record")) outputs.read("record", config.record);
    return;
  }
  Section record = outputs.section("record");
  record.read("folder", config.record);
  record.read_choice("format", config.record_format,
                     {{"png", std::string("png")}, {"ffv1", std::string("ffv1")}});
  record.done();
}

}  // namespace

LiveConfig read_live_config(Section root) {
  LiveConfig config;
  config.run = read_run_config(root);
  if (config.run.source.empty()) root.section("camera").fail("source", "where the pictures come from");
  read_nav(root, config);
  config.ptz = read_ptz_options(root.section("ptz"));
  if (is_replay(config)) config.ptz.reset();  // its angles are recorded
  if (config.ptz && !config.run.frames.pan_tilt) {
    root.section("frames").fail("base_from_camera", "pan_tilt: {...}, as ptz.device turns the camera");
  }
  if (config.ptz && config.ptz->gimbal && config.nav != NavSource::kMavlink)
    root.section("ptz").fail("device", "mavlink with nav: mavlink+URL, the autopilot whose gimbal it is");
  if (config.ptz && config.ptz->fill && !config.run.zoom_table)
    root.section("ptz").fail("fill", "camera.zoom_table with it, the lens at each zoom");
  Section outputs = root.section("outputs");
  config.mavlink = mavlink::read_mavlink_options(outputs);
  config.mavlink.link.gimbal = config.run.frames.pan_tilt.has_value();
  read_record(outputs, config);
  config.station = read_station_options(outputs);
  if (is_replay(config)) {
    // What was seen then must not steer a vehicle now, and is recorded already.
    config.mavlink.send = false;
    config.record.clear();
  } else if (config.mavlink.send && config.nav != NavSource::kMavlink) {
    outputs.section("mavlink").fail("send", "false, as nav is no autopilot");
  }
  outputs.done();
  return config;
}

}  // namespace perch
