#include "perch/detection/edge_blur.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// The pixel's own width, and a lens sharper than any.
constexpr double kLeast = 0.3 * 0.3, kMost = 4.0 * 4.0;  // px^2

// A blur is as wide as expected to a third, and round to a fifth, unless samples say otherwise.
constexpr double kExpected = 0.6, kRound = 0.4;  // of the squared width

}  // namespace

Eigen::Matrix2d fit_blur(std::span<const WidthSample> samples, double expected_px) {
  const double expected = expected_px * expected_px;
  // Mean of both axes, half their difference, and the same along the diagonals: n' C n of the angle 2 a.
  Eigen::Vector3d x(expected, 0, 0);
  const Eigen::Vector3d prior = Eigen::Vector3d(kExpected, kRound, kRound) * expected;
  double scale = 1;
  for (int round = 0; round < 4; ++round) {
    Eigen::Matrix3d A = prior.cwiseAbs2().cwiseInverse().asDiagonal();
    Eigen::Vector3d b(expected / (prior(0) * prior(0)), 0, 0);
    double sum = 0, count = 0;
    for (const WidthSample& s : samples) {
      const Eigen::Vector2d& n = s.normal;
      const Eigen::Vector3d row(1, n.x() * n.x() - n.y() * n.y(), 2 * n.x() * n.y());
      const double r = s.squared - row.dot(x), variance = s.variance * scale;
      const double weight = round == 0 ? 1 : 1 / (1 + 0.25 * r * r / variance);
      A += weight / variance * row * row.transpose();
      b += weight / variance * s.squared * row;
      sum += weight * r * r / s.variance;
      count += weight;
    }
    x = A.ldlt().solve(b);
    if (round > 0 && count > 3) scale = std::max(1.0, sum / count);
  }
  if (!x.allFinite()) x = {expected, 0, 0};
  const double mean = std::clamp(x(0), kLeast, kMost);
  const double most = mean - kLeast, stretch = std::hypot(x(1), x(2));
  const double part = stretch > most ? most / stretch : 1;
  Eigen::Matrix2d C;
  C << mean + part * x(1), part * x(2), part * x(2), mean - part * x(1);
  return C;
}

double texture_together(double blur_px2) { return 2 * M_PI * M_SQRT2 * blur_px2; }

}  // namespace perch
