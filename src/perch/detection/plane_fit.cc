#include "perch/detection/plane_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace perch {
namespace {

using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

Eigen::Matrix3d matrix_of(const PlaneStep& d) {
  Eigen::Matrix3d D;
  D << d(0), d(1), d(2), d(3), d(4), d(5), d(6), d(7), 0;
  return D;
}

Vector9 row_of(const EdgeOffset& o) {
  Vector9 row;
  row << o.jacobian, o.white;
  return row / o.sigma;
}

// The median of |residual| as a standard deviation; of few, as large as they are.
double robust_scale(std::vector<double>& residuals) {
  if (residuals.empty()) return 1;
  const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), middle, residuals.end());
  return 1.4826 * *middle;
}

}  // namespace

Eigen::Matrix3d corrected(const Eigen::Matrix3d& image_from_plane, const ImageFrame& frame,
                          const PlaneStep& step) {
  const Eigen::Matrix3d H = frame.to_image() * (Eigen::Matrix3d::Identity() + matrix_of(step)) *
                            frame.from_image() * image_from_plane;
  return H / H.norm();
}

PlaneStep step_between(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to, const ImageFrame& frame) {
  Eigen::Matrix3d D = frame.from_image() * to * from.inverse() * frame.to_image();
  D /= D(2, 2);
  D -= Eigen::Matrix3d::Identity();
  PlaneStep step;
  step << D(0, 0), D(0, 1), D(0, 2), D(1, 0), D(1, 1), D(1, 2), D(2, 0), D(2, 1);
  return step;
}

PlaneStep step_jacobian(const Eigen::Vector2d& image, const Eigen::Vector2d& gradient,
                        const ImageFrame& frame) {
  const Eigen::Vector2d u = (image - frame.centre) / frame.radius, g = frame.radius * gradient;
  PlaneStep row;
  const double along = -g.dot(u);
  row << g.x() * u.x(), g.x() * u.y(), g.x(), g.y() * u.x(), g.y() * u.y(), g.y(), along * u.x(),
      along * u.y();
  return row;
}

PlaneFit fit_plane(std::vector<EdgeOffset>& offsets, const ImageFrame& frame, double sigma_growth,
                   double steepest) {
  PlaneFit fit;
  Vector9 x = Vector9::Zero();
  Matrix9 information;
  std::vector<double> residuals;
  double scale = 0;
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    residuals.clear();
    for (const EdgeOffset& o : offsets) residuals.push_back(std::abs(o.offset / o.sigma - row_of(o).dot(x)));
    scale = std::max(robust_scale(residuals), 0.3);
    information.setZero();
    Vector9 pull = Vector9::Zero();
    // Twice the scale: 95 % efficient on Gaussian noise, Cauchy's.
    const double bound = 2.4 * scale;
    for (EdgeOffset& o : offsets) {
      const Vector9 row = row_of(o);
      const double r = (o.offset / o.sigma - row.dot(x)) / bound;
      // The first round knows no better than that all are right.
      o.weight = round == 0 ? 1 / (1 + std::abs(r)) : 1 / (1 + r * r);
      information.selfadjointView<Eigen::Lower>().rankUpdate(row, o.weight);
      pull += (o.weight * o.offset / o.sigma) * row;
    }
    information.template triangularView<Eigen::StrictlyUpper>() = information.transpose();
    Matrix9 held = information;
    const double perspective = 1 / std::pow(steepest * frame.radius, 2);
    held(6, 6) += perspective;
    held(7, 7) += perspective;
    held(8, 8) += 1 / (sigma_growth * sigma_growth);
    held.diagonal() += Vector9::Constant(1e-12 * held.trace());
    x = held.ldlt().solve(pull);
    if (!x.allFinite()) {
      x.setZero();
      break;
    }
  }
  fit.step = x.head<8>();
  fit.growth = x(8);
  fit.scale = scale;
  const Vector9 by_growth = information.col(8);
  const double of_growth = information(8, 8) + 1 / (sigma_growth * sigma_growth);
  fit.information =
      information.topLeftCorner<8, 8>() - by_growth.head<8>() * by_growth.head<8>().transpose() / of_growth;
  double squares = 0, weights = 0;
  for (const EdgeOffset& o : offsets) {
    const double r = o.offset - o.sigma * row_of(o).dot(x);
    squares += o.weight * r * r;
    weights += o.weight;
  }
  fit.rms_px = weights > 0 ? std::sqrt(squares / weights) : 0;
  fit.weight = offsets.empty() ? 0 : weights / static_cast<double>(offsets.size());
  return fit;
}

}  // namespace perch
