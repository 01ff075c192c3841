#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>

namespace perch {

using Matrix23d = Eigen::Matrix<double, 2, 3>;

// The lens of OpenCV and mrcal (PINHOLE, OPENCV4, 5, 8, 12) in closed form, 10 times faster than
// mrcal_project with its gradients and equal to it up to rounding. With (x, y) = (X, Y) / Z and s = x^2 +
// y^2:
//
//   c = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)
//   u = c x + 2 p1 x y + p2 (s + 2 x^2) + s1 s + s2 s^2        pixel = (fx u + cx, fy v + cy)
//   v = c y + p1 (s + 2 y^2) + 2 p2 x y + s3 s + s4 s^2
//
// Such a polynomial folds: beyond some radius the picture turns inside out, and a point far outside the
// picture lands in it. A point counts as seen only where (x, y) -> (u, v) can be inverted: before the radial
// part's first turning point or pole, and with a positive determinant.
class OpencvLens {
 public:
  // `intrinsics`: fx fy cx cy, then the 0, 4, 5, 8 or 12 coefficients k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.
  explicit OpencvLens(std::span<const double> intrinsics);

  // False where the point is not seen. `jacobian`, d pixel / d p, may be null.
  bool project(const Eigen::Vector3d& p, Eigen::Vector2d& pixel, Matrix23d* jacobian) const;

 private:
  // s at the first turning point or pole of r c(r^2); infinite where there is none.
  double invertible_radius_squared() const;

  double fx_, fy_, cx_, cy_;
  double k1_ = 0, k2_ = 0, p1_ = 0, p2_ = 0, k3_ = 0, k4_ = 0, k5_ = 0, k6_ = 0;
  double s1_ = 0, s2_ = 0, s3_ = 0, s4_ = 0;
  double max_s_ = std::numeric_limits<double>::infinity();
};

// In the header so that the cost functions can take it in.
inline bool OpencvLens::project(const Eigen::Vector3d& p, Eigen::Vector2d& pixel, Matrix23d* jacobian) const {
  if (!(p.z() > 0)) return false;
  const double inverse_z = 1 / p.z();
  const double x = p.x() * inverse_z, y = p.y() * inverse_z;
  const double s = x * x + y * y;
  if (!(s < max_s_)) return false;

  const double inverse_denominator = 1 / (1 + s * (k4_ + s * (k5_ + s * k6_)));
  const double c = (1 + s * (k1_ + s * (k2_ + s * k3_))) * inverse_denominator;
  const double dc_ds =
      (k1_ + s * (2 * k2_ + 3 * s * k3_) - c * (k4_ + s * (2 * k5_ + 3 * s * k6_))) * inverse_denominator;
  const double u = c * x + 2 * p1_ * x * y + p2_ * (s + 2 * x * x) + s * (s1_ + s * s2_);
  const double v = c * y + p1_ * (s + 2 * y * y) + 2 * p2_ * x * y + s * (s3_ + s * s4_);

  const double skewed = 2 * (x * y * dc_ds + p1_ * x + p2_ * y);
  const double du_ds = 2 * (s1_ + 2 * s * s2_), dv_ds = 2 * (s3_ + 2 * s * s4_);  // of the thin prism, twice
  const double du_dx = c + 2 * x * x * dc_ds + 2 * p1_ * y + 6 * p2_ * x + x * du_ds;
  const double du_dy = skewed + y * du_ds;
  const double dv_dx = skewed + x * dv_ds;
  const double dv_dy = c + 2 * y * y * dc_ds + 6 * p1_ * y + 2 * p2_ * x + y * dv_ds;
  if (!(du_dx * dv_dy - du_dy * dv_dx > 0)) return false;

  pixel << fx_ * u + cx_, fy_ * v + cy_;
  if (jacobian) {
    const double fx = fx_ * inverse_z, fy = fy_ * inverse_z;
    *jacobian << fx * du_dx, fx * du_dy, -fx * (du_dx * x + du_dy * y),  //
        fy * dv_dx, fy * dv_dy, -fy * (dv_dx * x + dv_dy * y);
  }
  return true;
}

}  // namespace perch
