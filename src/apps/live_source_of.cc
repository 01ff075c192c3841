#include "live_source_of.h"

#include <stdexcept>
#include <utility>

#include "perch/config/error.h"
#include "perch/simulation/live_simulation.h"

namespace perch {
namespace {

// What follows "flight:", "sim:".
std::string rest_of(const std::string& source) { return source.substr(source.find(':') + 1); }

// The lens at the zoom that the run is at; of a replay only its size counts, as each frame has its own.
CameraModel zoomed_camera(const LiveConfig& config) {
  const ZoomTable& table = *config.run.zoom_table;
  if (config.ptz && !config.ptz->gimbal) {
    const auto camera = table.at(config.ptz->zoom);
    if (camera) return *camera;
    throw ConfigError("ptz.zoom: expected one that camera.zoom_table was calibrated for, found " +
                      std::to_string(config.ptz->zoom));
  }
  if (config.nav != NavSource::kFlight) {
    throw ConfigError(
        "camera.zoom_table: expected ptz.device: visca... or camera.model, as nothing else tells the zoom");
  }
  return table.entries().front().model;
}

}  // namespace

OpenedSource open_source_of(const LiveConfig& config) {
  const RunConfig& run = config.run;
  std::unique_ptr<LiveSource> pictures;
  std::optional<CameraModel> camera;
  std::optional<Rigid3> body_from_camera;
  std::optional<Flight> flight;
  if (is_replay(config)) {
    flight = read_flight(rest_of(run.source));
    camera = flight->camera;
    body_from_camera = flight->body_from_camera;
  } else if (run.source.starts_with("sim:")) {
    auto simulation = open_live_simulation(rest_of(run.source), run.live);
    camera = simulation->flight().simulation().camera;
    body_from_camera = simulation->flight().simulation().body_from_camera;
    pictures = std::move(simulation);
  }
  if (!run.camera_model.empty()) camera = read_camera_model(run.camera_model);
  if (run.zoom_table) camera = zoomed_camera(config);
  if (!camera) {
    throw ConfigError("camera.model: expected the camera's model, as camera.source does not tell it");
  }
  if (!pictures) pictures = open_live_source(run.source, run.live, run.channel);
  return {std::move(pictures), *camera, body_from_camera, std::move(flight)};
}

std::optional<Rigid3> body_from_base_of(const LiveConfig& config, const OpenedSource& source) {
  const FrameChain& frames = config.run.frames;
  if (frames.body_from_base || !source.body_from_camera) return frames.body_from_base;
  return *source.body_from_camera * inverse(base_from_camera(frames, HeadAngles{}));
}

}  // namespace perch
