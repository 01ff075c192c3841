#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/geometry/rigid3.h"

namespace perch {

// The texts of cam0/sensor.yaml and cam0/camera.cameramodel (docs/FORMATS.md). Numbers have 17 digits: what
// is read back is what was, to the last bit; but for T_BS, a matrix there and a quaternion here.

struct SensorFile {
  CameraModel camera;
  std::optional<Rigid3> body_from_camera;  // T_BS; left out where nobody knows it
  double rate_hz = 30;
  std::string heading;  // comment lines at the top, with their # and line ends
};

std::string sensor_yaml(const SensorFile& sensor);
// Whether sensor.yaml can describe the lens. camera.cameramodel can any.
bool sensor_yaml_has_lens(const CameraModel& camera);
std::string camera_model_text(const CameraModel& camera);

// "1, 2, 3", each with 17 digits.
std::string list_of_numbers(const std::vector<double>& values);

}  // namespace perch
