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
    double a01 = 0, a02 = 0, a11 = 0, a12 = 0, a22 = 0, information = 0;
    for (const WidthSample& s : samples) {
      const double u = s.normal.x() * s.normal.x() - s.normal.y() * s.normal.y();
      const double v = 2 * s.normal.x() * s.normal.y();
      const double r = s.squared - x(0) - x(1) * u - x(2) * v, variance = s.variance * scale;
      const double weighted = 1 / (round == 0 ? variance : variance + 0.25 * r * r);
      information += weighted;
      a01 += weighted * u;
      a02 += weighted * v;
      a11 += weighted * u * u;
      a12 += weighted * u * v;
      a22 += weighted * v * v;
      b += weighted * s.squared * Eigen::Vector3d(1, u, v);
      sum += weighted * r * r;
      count += weighted * variance;
    }
    sum *= scale;
    Eigen::Matrix3d products;
    products << information, a01, a02, a01, a11, a12, a02, a12, a22;
    A += products;
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
