#pragma once

#include <cairo.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "perch/target/draw.h"

namespace perch {

// A target drawn head-on on a ground of one grey level. Pixel (0, 0) covers [0, 1) x [0, 1) of `pixel`'s
// coordinates, which is libapriltag's convention.
struct Raster {
  int width = 0, height = 0;
  std::vector<uint8_t> grey;
  Eigen::Vector2d upper_left = Eigen::Vector2d::Zero();  // m
  double per_metre = 1;                                  // px

  Eigen::Vector2d pixel(const Eigen::Vector2d& p_target) const {
    return {(p_target.x() - upper_left.x()) * per_metre, (upper_left.y() - p_target.y()) * per_metre};
  }
  int at(const Eigen::Vector2d& p_target) const {
    const Eigen::Vector2d p = pixel(p_target);
    return grey.at(static_cast<size_t>(static_cast<int>(p.y()) * width + static_cast<int>(p.x())));
  }
};

// `margin` of the ground on each side, m.
inline Raster raster_of(const LandingTarget& target, double per_metre, double margin, double ground = 0.5) {
  const Bounds bounds = printed_bounds(target);
  Raster raster;
  raster.per_metre = per_metre;
  raster.upper_left = {bounds.lower_left.x() - margin, bounds.upper_right.y() + margin};
  const Eigen::Vector2d extent =
      bounds.upper_right - bounds.lower_left + Eigen::Vector2d::Constant(2 * margin);
  raster.width = static_cast<int>(std::ceil(extent.x() * per_metre - 1e-6));
  raster.height = static_cast<int>(std::ceil(extent.y() * per_metre - 1e-6));
  cairo_surface_t* surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, raster.width, raster.height);
  cairo_t* cr = cairo_create(surface);
  cairo_set_source_rgb(cr, ground, ground, ground);
  cairo_paint(cr);
  cairo_scale(cr, per_metre, -per_metre);
  cairo_translate(cr, -raster.upper_left.x(), -raster.upper_left.y());
  draw_target(cr, target);
  cairo_surface_flush(surface);
  const unsigned char* data = cairo_image_surface_get_data(surface);
  const int stride = cairo_image_surface_get_stride(surface);
  for (int y = 0; y < raster.height; ++y) {
    for (int x = 0; x < raster.width; ++x) raster.grey.push_back(data[y * stride + 4 * x]);
  }
  cairo_destroy(cr);
  cairo_surface_destroy(surface);
  return raster;
}

}  // namespace perch
