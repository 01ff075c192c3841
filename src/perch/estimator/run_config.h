#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "perch/camera/image_source.h"
#include "perch/camera/live_source.h"
#include "perch/camera/zoom_table.h"
#include "perch/config/section.h"
#include "perch/detection/make_detector.h"
#include "perch/frames/frame_chain.h"
#include "perch/pose/pose_estimator.h"
#include "perch/target/landing_target.h"
#include "perch/tracking/filter.h"

namespace perch {

// What the estimator is given beside the pictures of a recorded flight.
enum class ReplayAids {
  kRecorded,    // of a live run's flight: what the live run's was given; of any other as below
  kNavigation,  // what the flight's navigation and gimbal say
};

// The one YAML file of a run, live or batch (docs/FORMATS.md, Configuration).
struct RunConfig {
  LandingTarget target;
  std::string source;                   // camera.source; empty: the program's own argument says
  std::filesystem::path camera_model;   // camera.model; empty: the flight's own
  std::optional<ZoomTable> zoom_table;  // camera.zoom_table, in place of a model: one for each frame's zoom
  Channel channel = Channel::kGrey;
  LiveOptions live;  // the rest of `camera`: what a live source is to do
  FrameChain frames;
  DetectionOptions detection;
  PoseOptions pose;
  TrackingOptions tracking;
  ReplayAids replay_aids = ReplayAids::kRecorded;
};

// Reads the whole document. Throws ConfigError for anything that is not as it should be; nothing starts then.
RunConfig read_run_config(Section root);

}  // namespace perch
