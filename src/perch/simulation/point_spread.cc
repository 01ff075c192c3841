#include "perch/simulation/point_spread.h"

#include <cmath>
#include <stdexcept>

namespace perch {

namespace {

// The second antiderivative of the Gaussian: x Phi(x) + sigma^2 g(x).
double spread_ramp(double x, double sigma) {
  if (sigma == 0) return x > 0 ? x : 0;
  const double z = x / sigma;
  return x * 0.5 * std::erfc(-z * M_SQRT1_2) + sigma * std::exp(-z * z / 2) / std::sqrt(2 * M_PI);
}

}  // namespace

PointSpread::PointSpread(double sigma_px, int cells) : cells_(cells) {
  if (!(sigma_px >= 0 && 4 * sigma_px <= kMaxRadius)) throw std::invalid_argument("blur out of bounds");
  // The Gaussian beyond 4 sigma holds 6e-5; a cell reaches half a pixel, a pixel begins half a pixel early.
  if (sigma_px > 0) radius_ = static_cast<int>(std::ceil(4 * sigma_px));
  const int n = 2 * radius_ + 1;
  weights_.assign(static_cast<size_t>(cells * n), 0);
  whole_.assign(static_cast<size_t>(n), 0);
  std::vector<double> exact;
  double sum = 0;
  for (int cell = 0; cell < cells; ++cell) {
    const double left = -0.5 + static_cast<double>(cell) / cells, right = -0.5 + (cell + 1.0) / cells;
    for (int d = -radius_; d <= radius_; ++d) {
      exact.push_back(spread_ramp(d + 0.5 - left, sigma_px) - spread_ramp(d + 0.5 - right, sigma_px) -
                      spread_ramp(d - 0.5 - left, sigma_px) + spread_ramp(d - 0.5 - right, sigma_px));
      sum += exact.back();
    }
  }
  for (size_t i = 0; i < exact.size(); ++i) {
    weights_[i] = static_cast<float>(exact[i] / sum);
    whole_[i % static_cast<size_t>(n)] += weights_[i];
  }
}

}  // namespace perch
