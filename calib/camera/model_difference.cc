#include "calib/camera/model_difference.h"

#include <cmath>
#include <limits>

#include "perch/geometry/so3.h"

namespace perch {

ModelDifference model_difference(const CameraModel& one, const CameraModel& other, int columns, int rows,
                                 const std::vector<double>& weight) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  ModelDifference difference;
  difference.length = {columns, rows, std::vector<double>(static_cast<size_t>(columns * rows), kNaN)};
  difference.shift.assign(difference.length.values.size(), Eigen::Vector2d::Constant(kNaN));
  struct Place {
    size_t at;
    Eigen::Vector2d pixel;
    Eigen::Vector3d ray;
  };
  std::vector<Place> places;
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto at = static_cast<size_t>(row * columns + column);
      const Eigen::Vector2d pixel = map_pixel(one.width(), one.height(), difference.length, column, row);
      const auto mine = one.ray_from_pixel(pixel), others = other.ray_from_pixel(pixel);
      if (!mine || !others) continue;
      places.push_back({at, pixel, *mine});
      if (std::isfinite(weight[at])) correlation += weight[at] * *others * mine->transpose();
    }
  }
  if (!(correlation.norm() > 0)) return difference;
  const Eigen::Matrix3d R = nearest_rotation(correlation);  // Kabsch: other = R one, at least squares
  difference.rotation = so3_log(Eigen::Quaterniond(R));
  for (const auto& place : places) {
    const auto pixel = other.pixel_from_camera(R * place.ray);
    if (!pixel) continue;
    difference.shift[place.at] = *pixel - place.pixel;
    difference.length.values[place.at] = difference.shift[place.at].norm();
  }
  return difference;
}

}  // namespace perch
