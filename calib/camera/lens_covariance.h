#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "calib/camera/lens_fit.h"

namespace perch {

// How well a fit is known. The lens alone is not: a centre that is off and boards that are turned look alike.
// So mrcal asks where a point that the boards' mean frame holds still is projected to ("mean-pcam"): with the
// boards' poses T_f,
//
//   q = project(intrinsics, mean over f of T_f(T_f^-1(p))),
//
// whose inner part moves by w x p + t when the poses do: w = mean w_f, t = mean (d t_f - w_f x t_f). Hence
// one covariance, of the intrinsics and that drift, carries all:
//
//   Cov = sigma^2 A' M A,  A = N^-1 E,  N = J'J,  M = J'J of the boards' rows alone,
//
// with E the columns of the state that intrinsics, w and t are linear in. Without regularisation M = N.
struct LensCovariance {
  // (intrinsics, w [rad], t [m]): square, of intrinsics.size() + 6. Rows of intrinsics that were not solved
  // for (a spline's focal lengths and centre) are 0.
  Eigen::MatrixXd matrix;
  Eigen::Vector2d warp_sigma = Eigen::Vector2d::Zero();  // m

  Eigen::MatrixXd intrinsics() const { return matrix.topLeftCorner(matrix.rows() - 6, matrix.cols() - 6); }
};

// Throws CalibrationError when the pictures leave something undecided (J'J has no inverse).
LensCovariance lens_covariance(const BoardViews& views, const LensFit& fit);

constexpr double kAtInfinity = std::numeric_limits<double>::infinity();

// d pixel / d (intrinsics, w, t) of a point of the camera's frame; of a direction when `far` (t has no part
// in it). Empty (0 columns) where the lens does not see the point.
Eigen::Matrix<double, 2, Eigen::Dynamic> pixel_by_lens(const LensFit& fit, const Eigen::Vector3d& p_camera,
                                                       bool far);

// Of the projection of what is seen at `pixel` and `range` m away: px^2. NaN where the lens sees nothing.
Eigen::Matrix2d pixel_covariance(const LensFit& fit, const CameraModel& model,
                                 const LensCovariance& covariance, const Eigen::Vector2d& pixel,
                                 double range);

// The standard deviation in the worst direction, px.
double worst_sigma(const Eigen::Matrix2d& covariance);

// Over the picture: columns x rows of it, the outermost at its edge pixels; row by row.
struct SensorMap {
  int columns = 0, rows = 0;
  std::vector<double> values;  // NaN: none
  double at(int column, int row) const { return values[static_cast<size_t>(row * columns + column)]; }
};
Eigen::Vector2d map_pixel(int width, int height, const SensorMap& map, int column, int row);
SensorMap uncertainty_map(const LensFit& fit, const LensCovariance& covariance, double range, int columns,
                          int rows);

}  // namespace perch
