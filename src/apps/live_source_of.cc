#include "live_source_of.h"

#include <stdexcept>
#include <utility>

#include "perch/config/error.h"
#include "perch/simulation/live_simulation.h"

namespace perch {
namespace {

// What follows "flight:", "sim:".
std::string rest_of(const std::string& source) { return source.substr(source.find(':') + 1); }

}  // namespace

OpenedSource open_source_of(const LiveConfig& config) {
  const RunConfig& run = config.run;
  std::optional<CameraModel> camera;
  OpenedSource opened{nullptr, CameraModel::pinhole(1, 1, 0, 0, 1, 1), std::nullopt, std::nullopt};
  if (is_replay(config)) {
    opened.flight = read_flight(rest_of(run.source));
    camera = opened.flight->camera;
    opened.body_from_camera = opened.flight->body_from_camera;
  }
  if (run.source.starts_with("sim:")) {
    auto simulation = open_live_simulation(rest_of(run.source), run.live);
    camera = simulation->flight().simulation().camera;
    opened.body_from_camera = simulation->flight().simulation().body_from_camera;
    opened.pictures = std::move(simulation);
  } else {
    opened.pictures = open_live_source(run.source, run.live, run.channel);
  }
  if (!run.camera_model.empty()) camera = read_camera_model(run.camera_model);
  if (!camera) {
    throw ConfigError("camera.model: expected the camera's model, as " + run.source + " does not tell it");
  }
  opened.camera = *camera;
  return opened;
}

}  // namespace perch
