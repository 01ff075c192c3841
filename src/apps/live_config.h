#pragma once

#include <filesystem>
#include <optional>

#include "live_head.h"
#include "perch/config/section.h"
#include "perch/estimator/run_config.h"
#include "perch/links/mavlink/mavlink_options.h"
#include "perch/links/nmea/receiver.h"
#include "perch/links/stream_url.h"
#include "perch/station/station_options.h"

namespace perch {

// Where attitude and velocity come from beside the pictures.
enum class NavSource {
  kNone,
  kFlight,   // what the replayed flight has recorded
  kMavlink,  // an autopilot
  kNmea,     // a receiver of satellites, perhaps with an inertial unit: for comparison, and for gravity
};

// What perch-live reads of its YAML file (docs/FORMATS.md, Configuration).
struct LiveConfig {
  RunConfig run;
  NavSource nav = NavSource::kNone;
  std::optional<StreamUrl> nav_url;  // with kMavlink and kNmea
  nmea::ReceiverOptions receiver;    // with kNmea
  mavlink::MavlinkOptions mavlink;
  std::optional<PtzOptions> ptz;  // a head that turns the camera
  std::filesystem::path record;   // outputs.record; empty: nothing is recorded
  std::string record_format = "png";
  StationOptions station;
};

// Of a replay `nav: mavlink+URL` and the like mean what the flight has recorded of it: the configuration of
// the live run can be used as it is. Nothing is sent then, and nothing recorded. Throws ConfigError for
// anything that is not as it should be; nothing starts then.
LiveConfig read_live_config(Section root);

// camera.source is a recorded flight.
inline bool is_replay(const LiveConfig& config) { return config.run.source.starts_with("flight:"); }

}  // namespace perch
