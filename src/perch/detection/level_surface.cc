#include "perch/detection/level_surface.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// Of a plane, and as many again that show whether it is one; of a curved surface.
constexpr size_t kLeastOfPlane = 8, kLeastOfCurved = 24;

// No light is more even than this: paper, ink and the sensor's rows.
constexpr double kLeastSpread = 0.2;  // grey levels

}  // namespace

LevelSurface::Coefficients LevelSurface::row_at(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d u = (pixel - origin_) / reach_;
  Coefficients row;
  row << 1, u.x(), u.y(), u.x() * u.x(), u.x() * u.y(), u.y() * u.y();
  return row;
}

void LevelSurface::fit(std::span<const LevelSample> samples) {
  variance_ = Level{}.variance;
  x_.setZero();
  if (samples.size() < kLeastOfPlane) return;
  origin_.setZero();
  for (const LevelSample& s : samples) origin_ += s.pixel / static_cast<double>(samples.size());
  reach_ = 1;
  for (const LevelSample& s : samples) reach_ = std::max(reach_, (s.pixel - origin_).norm());
  const int unknowns = samples.size() < kLeastOfCurved ? 3 : 6;
  rows_.clear();
  for (const LevelSample& s : samples) {
    rows_.push_back(row_at(s.pixel));
    rows_.back().tail(6 - unknowns).setZero();
  }
  // Cauchy's loss about what the round before left; the first takes all alike.
  double spread = 1e3;
  Eigen::Matrix<double, 6, 6> A;
  for (int round = 0; round < 4; ++round) {
    A.setZero();
    // What is not asked for stays zero.
    A.diagonal().tail(6 - unknowns).setOnes();
    Coefficients b = Coefficients::Zero();
    for (size_t i = 0; i < samples.size(); ++i) {
      const Coefficients& row = rows_[i];
      const LevelSample& s = samples[i];
      const double r = s.value - row.dot(x_), scale = spread + s.variance;
      const double weight = round == 0 ? 1 / scale : 1 / (scale + 0.25 * r * r);
      const Coefficients weighted = weight * row;
      A.noalias() += weighted * row.transpose();
      b += s.value * weighted;
    }
    A.diagonal() += Coefficients::Constant(1e-9 * A.trace());
    x_ = A.ldlt().solve(b);
    if (!x_.allFinite()) {
      x_.setZero();
      return;
    }
    double sum = 0, count = 0;
    for (size_t i = 0; i < samples.size(); ++i) {
      const double variance = samples[i].variance, r = samples[i].value - rows_[i].dot(x_);
      const double weight = round == 0 ? 1 : 1 / (1 + 0.25 * r * r / (spread + variance));
      sum += weight * (r * r - variance);
      count += weight;
    }
    spread = std::max(sum / std::max(count - unknowns, 1.0), kLeastSpread * kLeastSpread);
  }
  covariance_ = A.inverse();
  covariance_.bottomRightCorner(6 - unknowns, 6 - unknowns).setZero();
  variance_ = spread;
}

LevelSurface::Level LevelSurface::at(const Eigen::Vector2d& pixel) const {
  Coefficients row = row_at(pixel);
  const double u = row(1), v = row(2);
  const Eigen::Vector2d slope(x_(1) + 2 * x_(3) * u + x_(4) * v, x_(2) + x_(4) * u + 2 * x_(5) * v);
  return {row.dot(x_), variance_ + row.dot(covariance_ * row), slope / reach_};
}

}  // namespace perch
