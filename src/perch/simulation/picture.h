#pragma once

#include "perch/simulation/renderer.h"
#include "perch/simulation/sensor.h"

namespace perch {

// All that decides how a target looks in a picture, but for the camera and the pose.
struct PictureOptions {
  SceneOptions scene;
  OpticsOptions optics;
  SensorOptions sensor;
};

// One picture of a target, noise and all. Who needs several keeps a Renderer and a Sensor: making them takes
// three times as long as a picture.
inline cv::Mat_<uint8_t> render(const LandingTarget& target, const CameraModel& camera,
                                const Rigid3& camera_from_target, const PictureOptions& options = {},
                                uint64_t seed = 1) {
  const Renderer renderer(camera, target, options.scene, options.optics);
  return Sensor(options.sensor).picture(renderer.radiance(camera_from_target), seed);
}

}  // namespace perch
