#include "perch/ptz/zoom_to_fill.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// How far from the picture's middle, along its smaller side, as a part of half that side; infinite when the
// lens does not see that far.
double part_of_half(const CameraModel& camera, double angle) {
  const bool wide = camera.width() >= camera.height();
  const Eigen::Vector2d middle((camera.width() - 1) / 2.0, (camera.height() - 1) / 2.0);
  const auto ray = camera.ray_from_pixel(middle);
  if (!ray) return HUGE_VAL;
  const Eigen::Vector3d axis = wide ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  double most = 0;
  for (const double sign : {-1.0, 1.0}) {
    const auto pixel = camera.pixel_from_camera(Eigen::AngleAxisd(sign * angle, axis) * *ray);
    if (!pixel) return HUGE_VAL;
    most = std::max(most, (*pixel - middle).norm());
  }
  return most / (std::min(camera.width(), camera.height()) / 2.0);
}

}  // namespace

double zoom_to_fill(const ZoomLens& lens, double target, double aside, double fill) {
  const auto fits = [&](double zoom) {
    const CameraModel camera = lens(zoom);
    return part_of_half(camera, target) <= fill && part_of_half(camera, target + aside) <= 1;
  };
  if (!fits(0)) return 0;
  if (fits(1)) return 1;
  double low = 0, high = 1;
  // To a step of the EVI-D30's 1024.
  for (int i = 0; i < 10; ++i) {
    const double middle = (low + high) / 2;
    (fits(middle) ? low : high) = middle;
  }
  return low;
}

}  // namespace perch
