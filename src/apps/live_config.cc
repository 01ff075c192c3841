#include "live_config.h"

#include "perch/config/error.h"

namespace perch {
namespace {

constexpr std::string_view kMavlinkPrefix = "mavlink+";

void read_nav(Section& root, LiveConfig& config) {
  std::string nav = is_replay(config) ? "flight" : "none";
  root.read("nav", nav);
  if (nav == "none") return;
  if (nav == "flight") {
    // A camera that runs has no recording of an autopilot beside it.
    if (!is_replay(config)) root.fail("nav", "none or mavlink+URL, as camera.source is no flight");
    config.nav = NavSource::kFlight;
    return;
  }
  if (!nav.starts_with(kMavlinkPrefix)) root.fail("nav", "none, flight or mavlink+URL");
  // What was seen then must not steer a vehicle now.
  if (is_replay(config)) root.fail("nav", "none or flight, as camera.source is a recorded flight");
  config.nav = NavSource::kMavlink;
  try {
    config.autopilot = parse_stream_url(nav);
  } catch (const ConfigError& e) {
    root.fail("nav", std::string("mavlink+ and the URL of a byte stream (") + e.what() + ")");
  }
}

}  // namespace

LiveConfig read_live_config(Section root) {
  LiveConfig config;
  config.run = read_run_config(root);
  if (config.run.source.empty()) root.section("camera").fail("source", "where the pictures come from");
  read_nav(root, config);
  Section outputs = root.section("outputs");
  config.mavlink = mavlink::read_mavlink_options(outputs);
  if (config.mavlink.send && config.nav != NavSource::kMavlink) {
    outputs.section("mavlink").fail("send", "false, as nav is no autopilot");
  }
  if (outputs.has("record")) outputs.read("record", config.record);
  outputs.done();
  return config;
}

}  // namespace perch
