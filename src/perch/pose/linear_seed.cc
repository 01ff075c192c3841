#include "perch/pose/linear_seed.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

namespace perch {
namespace {

// Points this near to a line, as a part of their extent, tell nothing across it: no detector measures better.
constexpr double kFlat = 1e-4;

// Moves the points' centroid to the origin and their mean square distance from it to 2: p -> scale (p -
// centre).
struct Conditioner {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double scale = 0;
  bool spread = false;  // finite, and neither in one point nor (nearly) in a line

  explicit Conditioner(std::span<const Eigen::Vector2d> points) {
    for (const auto& p : points) centre += p;
    centre /= static_cast<double>(points.size());
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
    for (const auto& p : points) scatter += (p - centre) * (p - centre).transpose();
    scale = std::sqrt(2 * static_cast<double>(points.size()) / scatter.trace());
    // The ratio of the two eigenvalues, where it is small. Not "smaller": a NaN is no spread either.
    spread =
        std::isfinite(scale) && scatter.determinant() >= kFlat * kFlat * scatter.trace() * scatter.trace();
  }
  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const { return scale * (p - centre); }
};

}  // namespace

std::optional<PlaneView> plane_view(std::span<const Eigen::Vector2d> plane,
                                    std::span<const Eigen::Vector2d> image) {
  if (plane.size() != image.size() || plane.size() < 4) return std::nullopt;
  const Conditioner on_plane(plane), in_image(image);
  if (!on_plane.spread || !in_image.spread) return std::nullopt;

  // With the rows h1, h2, h3 of H as unknowns, F'F = [S 0 -Sx; 0 S -Sy; -Sx -Sy Sxx] with S = sum q q',
  // Sx = sum x1 q q', Sy = sum x2 q q', Sxx = sum (x1^2 + x2^2) q q'.
  Eigen::Matrix3d S = Eigen::Matrix3d::Zero(), Sx = S, Sy = S, Sxx = S;
  for (size_t i = 0; i < plane.size(); ++i) {
    const Eigen::Vector3d q = on_plane(plane[i]).homogeneous();
    const Eigen::Vector2d x = in_image(image[i]);
    const Eigen::Matrix3d qq = q * q.transpose();
    S += qq;
    Sx += x.x() * qq;
    Sy += x.y() * qq;
    Sxx += x.squaredNorm() * qq;
  }
  const Eigen::LLT<Eigen::Matrix3d> llt(S);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Eigen::Matrix3d solved_x = llt.solve(Sx), solved_y = llt.solve(Sy);
  const Eigen::Matrix3d schur = Sxx - Sx.transpose() * solved_x - Sy.transpose() * solved_y;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.compute(schur);
  // One null vector, not two: points in a line leave a second one, to rounding.
  if (eigen.info() != Eigen::Success || !(eigen.eigenvalues()(1) > 1e-10 * Sxx.trace())) return std::nullopt;
  const Eigen::Vector3d h3 = eigen.eigenvectors().col(0);
  Eigen::Matrix3d H;
  H << (solved_x * h3).transpose(), (solved_y * h3).transpose(), h3.transpose();
  // Back to the units of both sides.
  H.leftCols<2>() *= on_plane.scale;
  H.topRows<2>() /= in_image.scale;
  H.topRows<2>() += in_image.centre * H.row(2);
  return PlaneView{H, on_plane.centre};
}

std::optional<Rigid3> linear_seed(const PlaneView& view) {
  auto camera_from_target = pose_from_homography(view.H);
  if (camera_from_target) {
    const Eigen::Vector3d centre(view.centre.x(), view.centre.y(), 0);
    camera_from_target->translation -= camera_from_target->rotation * centre;
  }
  return camera_from_target;
}

std::optional<Rigid3> linear_seed(std::span<const Eigen::Vector2d> plane,
                                  std::span<const Eigen::Vector2d> image) {
  const auto view = plane_view(plane, image);
  return view ? linear_seed(*view) : std::nullopt;
}

std::optional<Rigid3> pose_from_homography(const Eigen::Matrix3d& homography) {
  if (!homography.allFinite()) return std::nullopt;
  // Positive depth of the target's origin.
  const Eigen::Matrix3d H = homography(2, 2) < 0 ? Eigen::Matrix3d(-homography) : homography;
  const double scale = 2 / (H.col(0).norm() + H.col(1).norm());
  if (!std::isfinite(scale)) return std::nullopt;
  // The orthonormal pair nearest to [r1 r2] is A (A'A)^-1/2, the paper's U V' of its SVD; of a 2x2 matrix M
  // the root is (M + sqrt(det M) I) / sqrt(trace M + 2 sqrt(det M)).
  const Eigen::Matrix<double, 3, 2> A = scale * H.leftCols<2>();
  const Eigen::Matrix2d M = A.transpose() * A;
  const double root_det = std::sqrt(std::max(0.0, M.determinant()));
  if (!(root_det > 1e-9)) return std::nullopt;  // seen edge-on
  const Eigen::Matrix2d root =
      (M + root_det * Eigen::Matrix2d::Identity()) / std::sqrt(M.trace() + 2 * root_det);
  const Eigen::Matrix<double, 3, 2> r = A * root.inverse();
  Eigen::Matrix3d R;
  R << r, r.col(0).cross(r.col(1));  // the determinant is +1
  const Rigid3 camera_from_target{Eigen::Quaterniond(R).normalized(), scale * H.col(2)};
  // A face seen from behind is not seen: the camera must be on the side of the face's z.
  if (!(R.col(2).dot(camera_from_target.translation) < 0)) return std::nullopt;
  return camera_from_target;
}

}  // namespace perch
