#include "bound.h"

#include <Eigen/LU>
#include <array>

namespace perch {
namespace {

// How far the target's corners go in the picture for a small change of a parameter, px per m or rad.
double pixels_per_unit(const CameraModel& camera, double size, const Rigid3& camera_from_target,
                       const PoseError& direction) {
  constexpr double kSmall = 1e-5;  // m, rad
  const Rigid3 moved = perturb(camera_from_target, kSmall * direction);
  double farthest = 0;
  for (const auto& corner : square_corners(Eigen::Vector2d::Constant(-size / 2), size)) {
    const Eigen::Vector3d p(corner.x(), corner.y(), 0);
    const auto before = camera.pixel_from_camera(camera_from_target * p);
    const auto after = camera.pixel_from_camera(moved * p);
    if (before && after) farthest = std::max(farthest, (*after - *before).norm());
  }
  return farthest / kSmall;
}

}  // namespace

PoseCovariance pose_bound(const Renderer& renderer, const SensorOptions& options, double target_size,
                          const Rigid3& camera_from_target, double step_px) {
  const Sensor sensor(options);
  const auto grey_at = [&](const Rigid3& pose) { return sensor.expected_grey(renderer.radiance(pose)); };
  std::array<cv::Mat_<float>, 6> slopes;
  for (int i = 0; i < 6; ++i) {
    const PoseError direction = PoseError::Unit(i);
    const double step =
        step_px / pixels_per_unit(renderer.camera(), target_size, camera_from_target, direction);
    const cv::Mat difference = grey_at(perturb(camera_from_target, step * direction)) -
                               grey_at(perturb(camera_from_target, -step * direction));
    slopes[static_cast<size_t>(i)] = difference / (2 * step);
  }
  const cv::Mat_<float> light = renderer.radiance(camera_from_target);
  const double grey_per_electron = 255 / options.full_well;
  PoseCovariance information = PoseCovariance::Zero();
  for (int v = 0; v < light.rows; ++v) {
    for (int u = 0; u < light.cols; ++u) {
      PoseError slope;
      for (int i = 0; i < 6; ++i) slope(i) = static_cast<double>(slopes[static_cast<size_t>(i)](v, u));
      if (slope.isZero(0)) continue;
      const double electrons = options.full_well * options.exposure * static_cast<double>(light(v, u));
      const double variance =
          grey_per_electron * grey_per_electron * (electrons + options.read_noise * options.read_noise) +
          1.0 / 12;
      information += slope * slope.transpose() / variance;
    }
  }
  return information.inverse();
}

SceneOptions without_texture(SceneOptions scene) {
  scene.ground.contrast = 0;
  scene.ground.stones = 0;
  return scene;
}

CameraModel window(const CameraModel& camera, const cv::Rect& part) {
  auto intrinsics = camera.intrinsics();
  intrinsics[2] -= part.x;
  intrinsics[3] -= part.y;
  return {camera.lens(), intrinsics, part.width, part.height};
}

}  // namespace perch
