#include "perch/flight/sensor_file.h"

#include <cstdio>

namespace perch {
namespace {

std::string seventeen_digits(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

std::string size_text(const CameraModel& camera) {
  return "[" + std::to_string(camera.width()) + ", " + std::to_string(camera.height()) + "]";
}

std::string mount_text(const Rigid3& body_from_camera) {
  const Eigen::Matrix3d R = body_from_camera.rotation.toRotationMatrix();
  const Eigen::Vector3d& p = body_from_camera.translation;
  std::string text = "T_BS:\n  cols: 4\n  rows: 4\n  data: [";
  for (int i = 0; i < 3; ++i) {
    text += list_of_numbers({R(i, 0), R(i, 1), R(i, 2), p[i]}) + ",\n         ";
  }
  return text + "0, 0, 0, 1]\n";
}

}  // namespace

std::string list_of_numbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + seventeen_digits(value);
  return text;
}

bool sensor_yaml_has_lens(const CameraModel& camera) {
  return camera.lens() == "LENSMODEL_PINHOLE" || camera.lens() == "LENSMODEL_OPENCV4";
}

std::string sensor_yaml(const SensorFile& sensor) {
  const CameraModel& camera = sensor.camera;
  const auto& k = camera.intrinsics();
  std::string text = sensor.heading + "sensor_type: camera\n";
  if (sensor.body_from_camera) {
    text += "# T_BS takes camera coordinates (x right, y down, z forward) to the body (FRD).\n" +
            mount_text(*sensor.body_from_camera);
  }
  text += "rate_hz: " + seventeen_digits(sensor.rate_hz) + "\nresolution: " + size_text(camera) +
          "\ncamera_model: pinhole\n";
  if (k.size() >= 4) text += "intrinsics: [" + list_of_numbers({k[0], k[1], k[2], k[3]}) + "]\n";
  if (camera.lens() == "LENSMODEL_PINHOLE") {
    text += "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n";
  } else if (camera.lens() == "LENSMODEL_OPENCV4") {
    text += "distortion_model: radial-tangential\ndistortion_coefficients: [" +
            list_of_numbers({k.begin() + 4, k.end()}) + "]\n";
  } else {
    text += "# The lens is none that this file can describe: see camera.cameramodel.\n";
  }
  return text;
}

std::string camera_model_text(const CameraModel& camera) {
  return "{\n    'lensmodel':  '" + camera.lens() + "',\n    'extrinsics': [ 0, 0, 0, 0, 0, 0 ],\n" +
         "    'intrinsics': [ " + list_of_numbers(camera.intrinsics()) + " ],\n    'imagersize': [ " +
         std::to_string(camera.width()) + ", " + std::to_string(camera.height()) + " ]\n}\n";
}

}  // namespace perch
