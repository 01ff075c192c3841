#include "live_config.h"

#include <algorithm>
#include <array>

#include "perch/config/error.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

struct NavScheme {
  std::string_view prefix;  // before the URL of a byte stream
  NavSource source;
  bool asked;  // message by message, instead of streams
};
constexpr std::array kSchemes = {NavScheme{"mavlink+", NavSource::kMavlink, false},
                                 NavScheme{"mavlink-request+", NavSource::kMavlink, true},
                                 NavScheme{"nmea+", NavSource::kNmea, false}};

Geodetic read_origin(Section origin) {
  for (const char* key : {"latitude_deg", "longitude_deg", "height"}) {
    if (!origin.has(key)) origin.fail(key, "the place of the world's origin by WGS84");
  }
  double latitude = 0, longitude = 0;
  Geodetic place;
  origin.read("latitude_deg", latitude, Range{-90, 90});
  origin.read("longitude_deg", longitude, Range{-180, 180});
  origin.read("height", place.height, Range{-1000, 100'000});
  origin.done();
  place.latitude = kRadFromDeg * latitude;
  place.longitude = kRadFromDeg * longitude;
  return place;
}

// Where `key` of `section` says that navigation comes from; whether it has to be asked.
bool read_nav_source(Section& section, std::string_view key, LiveConfig& config) {
  std::string nav = is_replay(config) ? "flight" : "none";
  section.read(key, nav);
  if (nav == "none") return false;
  config.nav = NavSource::kFlight;
  if (nav == "flight") {
    // A camera that runs has no recording of an autopilot beside it.
    if (!is_replay(config)) section.fail(key, "none, mavlink+URL or nmea+URL, as camera.source is no flight");
    return false;
  }
  const auto scheme =
      std::ranges::find_if(kSchemes, [&](const auto& s) { return nav.starts_with(s.prefix); });
  if (scheme == kSchemes.end())
    section.fail(key, "none, flight, mavlink+URL, mavlink-request+URL or nmea+URL");
  try {
    const StreamUrl url = parse_stream_url(nav.substr(scheme->prefix.size()));
    if (is_replay(config)) return false;
    config.nav = scheme->source;
    config.nav_url = url;
  } catch (const ConfigError& e) {
    section.fail(key, std::string(scheme->prefix) + " and the URL of a byte stream (" + e.what() + ")");
  }
  return scheme->asked;
}

// A source; or the source and what its coordinates are taken from.
bool read_nav(Section& root, LiveConfig& config) {
  if (!root.is_mapping_with("nav", "source")) return read_nav_source(root, "nav", config);
  Section nav = root.section("nav");
  const bool asked = read_nav_source(nav, "source", config);
  if (nav.has("origin")) {
    config.receiver.origin = read_origin(nav.section("origin"));
    if (config.nav == NavSource::kMavlink) nav.fail("origin", "nothing, as the autopilot has its own");
  }
  nav.done();
  return asked;
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
  const bool asked = read_nav(root, config);
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
  config.mavlink.link.ask_each = asked;
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
