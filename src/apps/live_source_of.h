#pragma once

#include <memory>
#include <optional>

#include "live_config.h"
#include "perch/camera/camera_model.h"
#include "perch/camera/live_source.h"
#include "perch/estimator/estimator.h"
#include "perch/flight/flight.h"

namespace perch {

// Where the pictures come from, with what the source itself knows of its camera and its mount.
struct OpenedSource {
  std::unique_ptr<LiveSource> pictures;
  CameraModel camera;
  std::optional<Rigid3> body_from_camera;
  std::optional<Flight> flight;  // of a replay: what was recorded beside the pictures
};

// Throws ConfigError and std::runtime_error naming what cannot be opened, or is not known of the camera.
OpenedSource open_source_of(const LiveConfig& config);

// frames.body_from_base, or what follows from where the source says that its camera sits; empty: nobody
// knows.
std::optional<Rigid3> body_from_base_of(const LiveConfig& config, const OpenedSource& source);

}  // namespace perch
