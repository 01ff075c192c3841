#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "calib/camera/board_view.h"
#include "perch/camera/camera_model.h"
#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch {

// Corners of a board straight from the projection: no pixels are drawn.
struct SyntheticBoards {
  BoardGrid grid{8, 6, 0.04};
  Eigen::Vector2d warp{0.001, -0.0005};  // m, as mrcal means it
  double stretch = 1;                    // of the columns' distance, unlike the grid has it
  double noise_px = 0.2;
  int views = 20;
  double tilt_deg = 40;                   // at most
  double nearest = 0.35, farthest = 0.7;  // m
  double spread = 0.95;                   // how much of the picture the boards' middles are in
  bool keep_partial = false;              // views with corners outside of the picture
};

inline Eigen::Vector3d board_point(const SyntheticBoards& s, int column, int row) {
  const double x = static_cast<double>(column) / (s.grid.columns - 1),
               y = static_cast<double>(row) / (s.grid.rows - 1);
  return {s.stretch * column * s.grid.spacing, row * s.grid.spacing,
          4 * s.warp.x() * x * (1 - x) + 4 * s.warp.y() * y * (1 - y)};
}

inline BoardViews synthetic_boards(const CameraModel& camera, const SyntheticBoards& s, TestRng& rng) {
  BoardViews all{s.grid, camera.width(), camera.height(), {}};
  const Eigen::Vector3d middle(0.5 * (s.grid.columns - 1) * s.grid.spacing,
                               0.5 * (s.grid.rows - 1) * s.grid.spacing, 0);
  while (static_cast<int>(all.views.size()) < s.views) {
    const double half = 0.5 * s.spread;
    const Eigen::Vector2d aim((0.5 + rng.uniform(-half, half)) * camera.width(),
                              (0.5 + rng.uniform(-half, half)) * camera.height());
    const auto ray = camera.ray_from_pixel(aim);
    if (!ray) continue;
    const double tilt = rng.uniform(0, s.tilt_deg) * kRadFromDeg, towards = rng.uniform(-M_PI, M_PI);
    // Facing the line of sight, turned in its plane, tilted.
    const Eigen::Quaterniond rotation =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), *ray) *
        so3_exp(tilt * Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
        so3_exp(Eigen::Vector3d(0, 0, rng.uniform(-0.3, 0.3)));
    const Eigen::Vector3d centre = rng.uniform(s.nearest, s.farthest) * *ray;
    BoardView view{"view" + std::to_string(all.views.size()), {}};
    for (int row = 0; row < s.grid.rows; ++row) {
      for (int column = 0; column < s.grid.columns; ++column) {
        const Eigen::Vector3d p = rotation * (board_point(s, column, row) - middle) + centre;
        const auto pixel = camera.pixel_from_camera(p);
        const bool seen = pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() <= camera.width() - 1 &&
                          pixel->y() <= camera.height() - 1;
        if (!seen) continue;
        const Eigen::Vector2d noise(s.noise_px * rng.normal(), s.noise_px * rng.normal());
        view.corners.push_back({column, row, *pixel + noise, 1});
      }
    }
    const auto full = static_cast<size_t>(s.grid.columns * s.grid.rows);
    if (view.corners.size() == full || (s.keep_partial && view.corners.size() > full / 2))
      all.views.push_back(view);
  }
  return all;
}

// 75 degrees across, 640 x 480.
inline CameraModel opencv8_camera() {
  return CameraModel("LENSMODEL_OPENCV8",
                     {420, 421, 322, 238, -0.25, 0.08, 0.0006, -0.0004, -0.01, 0.02, 0.005, -0.002}, 640,
                     480);
}
inline CameraModel opencv4_camera() {
  return CameraModel("LENSMODEL_OPENCV4", {420, 421, 322, 238, -0.18, 0.05, 0.0006, -0.0004}, 640, 480);
}

}  // namespace perch
