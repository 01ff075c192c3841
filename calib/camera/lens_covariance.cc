#include "calib/camera/lens_covariance.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <limits>

#include "calib/camera/mrcal_problem.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// How the state moves (intrinsics, w, t) and the warp: a column for each of these.
Eigen::MatrixXd interest(const LensFit& fit, const MrcalProblem::Linearisation& linear) {
  const auto n = static_cast<Eigen::Index>(fit.intrinsics.size());
  const auto states = linear.scale.size();
  Eigen::MatrixXd E = Eigen::MatrixXd::Zero(states, n + 8);
  const Eigen::Index locked = n - linear.intrinsics;  // 4, of a spline
  for (Eigen::Index i = 0; i < linear.intrinsics; ++i) E(i, locked + i) = 1;
  const double share = 1 / static_cast<double>(fit.camera_from_board.size());
  for (size_t f = 0; f < fit.camera_from_board.size(); ++f) {
    const auto& pose = fit.camera_from_board[f];
    const auto first = linear.first_pose + 6 * static_cast<Eigen::Index>(f);
    const Eigen::Matrix3d left = so3_left_jacobian(pose.head<3>());
    const Eigen::Vector3d translation = pose.tail<3>();
    E.block<3, 3>(first, n) = share * left.transpose();
    E.block<3, 3>(first, n + 3) = share * (skew(translation) * left).transpose();
    E.block<3, 3>(first + 3, n + 3) = share * Eigen::Matrix3d::Identity();
  }
  if (linear.first_warp >= 0) E.block<2, 2>(linear.first_warp, n + 6).setIdentity();
  return linear.scale.asDiagonal() * E;
}

}  // namespace

LensCovariance lens_covariance(const BoardViews& views, const LensFit& fit) {
  const MrcalProblem problem = problem_at(views, fit);
  const auto linear = problem.linearise(selections_of(fit, problem.lens));
  const Eigen::SparseMatrix<double>& Jt = linear.J_transposed;
  const Eigen::SparseMatrix<double> boards = Jt.leftCols(linear.board_measurements);
  const Eigen::SparseMatrix<double> M = boards * boards.transpose();
  const Eigen::SparseMatrix<double> N = Jt * Jt.transpose();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt(N);
  const bool regular = ldlt.info() == Eigen::Success && ldlt.vectorD().minCoeff() > 0;
  if (!regular) throw CalibrationError(fit.lens + ": the pictures leave part of the lens undecided");
  const Eigen::MatrixXd A = ldlt.solve(interest(fit, linear));
  Eigen::MatrixXd all = fit.sigma_px * fit.sigma_px * (A.transpose() * (M * A));
  if (!all.allFinite()) throw CalibrationError(fit.lens + ": the pictures leave part of the lens undecided");
  all = (0.5 * (all + all.transpose())).eval();
  LensCovariance covariance;
  covariance.warp_sigma = all.diagonal().tail<2>().cwiseMax(0).cwiseSqrt();
  covariance.matrix = all.topLeftCorner(all.rows() - 2, all.cols() - 2);
  return covariance;
}

Eigen::Matrix<double, 2, Eigen::Dynamic> pixel_by_lens(const LensFit& fit, const Eigen::Vector3d& p,
                                                       bool far) {
  const mrcal_lensmodel_t lens = mrcal_lens(fit.lens);
  const auto n = static_cast<Eigen::Index>(fit.intrinsics.size());
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> by_intrinsics(2, n);
  const mrcal_point3_t point{{p.x(), p.y(), p.z()}};
  mrcal_point2_t q;
  mrcal_point3_t gradient[2];
  if (!mrcal_project(&q, gradient, by_intrinsics.data(), &point, 1, &lens, fit.intrinsics.data())) return {};
  Matrix23d by_point;
  by_point << gradient[0].x, gradient[0].y, gradient[0].z, gradient[1].x, gradient[1].y, gradient[1].z;
  Eigen::Matrix<double, 2, Eigen::Dynamic> all(2, n + 6);
  all << by_intrinsics, -by_point * skew(p), by_point;
  if (far) all.rightCols<3>().setZero();
  return all;
}

Eigen::Matrix2d pixel_covariance(const LensFit& fit, const CameraModel& model,
                                 const LensCovariance& covariance, const Eigen::Vector2d& pixel,
                                 double range) {
  const bool far = !std::isfinite(range);
  const auto ray = model.ray_from_pixel(pixel);
  if (!ray) return Eigen::Matrix2d::Constant(kNaN);
  const auto D = pixel_by_lens(fit, far ? *ray : Eigen::Vector3d(range * *ray), far);
  if (D.cols() == 0 || !D.allFinite()) return Eigen::Matrix2d::Constant(kNaN);
  return D * covariance.matrix * D.transpose();
}

double worst_sigma(const Eigen::Matrix2d& c) {
  const double middle = 0.5 * c.trace(), half = std::hypot(0.5 * (c(0, 0) - c(1, 1)), c(0, 1));
  return std::sqrt(middle + half);
}

Eigen::Vector2d map_pixel(int width, int height, const SensorMap& map, int column, int row) {
  return {(width - 1.0) * column / (map.columns - 1), (height - 1.0) * row / (map.rows - 1)};
}

SensorMap uncertainty_map(const LensFit& fit, const LensCovariance& covariance, double range, int columns,
                          int rows) {
  SensorMap map{columns, rows, {}};
  const CameraModel model = fit.model();
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      map.values.push_back(worst_sigma(pixel_covariance(
          fit, model, covariance, map_pixel(fit.width, fit.height, map, column, row), range)));
    }
  }
  return map;
}

}  // namespace perch
