#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/flight/nav_track.h"
#include "perch/geometry/rigid3.h"

namespace perch {

struct GimbalSample {
  int64_t timestamp_ns = 0;    // camera clock
  double pan = 0, tilt = 0;    // rad
  std::optional<double> zoom;  // as the camera tells it; empty where it has not
};

// A recorded flight, an ASL (EuRoC) folder, without its pictures: those come from
// open_image_source("flight:" + folder). See docs/FORMATS.md.
struct Flight {
  std::filesystem::path folder;       // FLIGHT, the folder that holds mav0
  std::string name;                   // its last part
  std::optional<CameraModel> camera;  // camera.cameramodel, else sensor.yaml; absent when neither can be read
  std::optional<Rigid3> body_from_camera;  // sensor.yaml's T_BS
  NavTrack nav;               // nav0, else state_groundtruth_estimate0; empty when there is neither
  bool nav_is_truth = false;  // nav is the latter
  NavTrack truth;             // state_groundtruth_estimate0 beside nav0, on the camera's clock; or empty
  std::vector<GimbalSample> gimbal;
  std::vector<std::string> problems;  // "file:line: what", each thing that was skipped
};

// Throws std::runtime_error when the folder is no flight at all (no mav0/cam0/data.csv). Everything else that
// is wrong is skipped and noted in `problems`.
Flight read_flight(const std::filesystem::path& folder);

}  // namespace perch
