#include "perch/simulation/gust.h"

#include <cmath>

namespace perch {

Gust::Gust(double deviation, double correlation, RandomStream& random)
    : amplitude_(deviation * std::sqrt(2.0 / kSines)) {
  for (auto& axis : axes_) {
    for (int k = 0; k < kSines; ++k) {
      // The spectrum 1 / (1 + (w tau)^2) has the quantiles tan(u pi / 2) / tau. One sine from each twelfth of
      // it, but not from its endless tail: it has no finite acceleration.
      const double u = 0.9 * (k + random.uniform()) / kSines;
      axis[static_cast<size_t>(k)] = {std::tan(u * M_PI / 2) / correlation, random.uniform(0, 2 * M_PI)};
    }
  }
}

Eigen::Vector3d Gust::sum(double t, int derivative) const {
  Eigen::Vector3d total = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    for (const auto& [w, phase] : axes_[static_cast<size_t>(i)]) {
      total[i] += amplitude_ * std::pow(w, derivative) * std::sin(w * t + phase + derivative * M_PI / 2);
    }
  }
  return total;
}

}  // namespace perch
