#include "perch/camera/opencv_lens.h"

#include <algorithm>

namespace perch {

OpencvLens::OpencvLens(std::span<const double> intrinsics)
    : fx_(intrinsics[0]), fy_(intrinsics[1]), cx_(intrinsics[2]), cy_(intrinsics[3]) {
  double* const coefficients[] = {&k1_, &k2_, &p1_, &p2_, &k3_, &k4_, &k5_, &k6_, &s1_, &s2_, &s3_, &s4_};
  const size_t count = std::min(intrinsics.size() - 4, std::size(coefficients));
  for (size_t i = 0; i < count; ++i) *coefficients[i] = intrinsics[4 + i];
  max_s_ = invertible_radius_squared();
}

double OpencvLens::invertible_radius_squared() const {
  // With c = n / d, the slope of r c(r^2) is (n d + 2 s (n' d - n d')) / d^2: its sign is the numerator's.
  const auto invertible = [this](double s) {
    const double n = 1 + s * (k1_ + s * (k2_ + s * k3_)), dn = k1_ + s * (2 * k2_ + 3 * s * k3_);
    const double d = 1 + s * (k4_ + s * (k5_ + s * k6_)), dd = k4_ + s * (2 * k5_ + 3 * s * k6_);
    return d > 0 && n * d + 2 * s * (dn * d - n * dd) > 0;
  };
  // From 0.006 to 89.994 degrees off the axis in steps of 1 %: long lenses have large coefficients, and the
  // roots of a polynomial of degree 6 are not known better than by search either.
  double inside = 0;
  for (double outside = 1e-8; outside < 1e8; outside *= 1.01) {
    if (!invertible(outside)) {
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (inside + outside);
        (invertible(middle) ? inside : outside) = middle;
      }
      return inside;
    }
    inside = outside;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace perch
