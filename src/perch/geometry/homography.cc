#include "perch/geometry/homography.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace perch {
namespace {

// Moves the centroid to the origin and the mean distance from it to sqrt 2.
std::optional<Eigen::Matrix3d> conditioner(std::span<const Eigen::Vector2d> points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  double distance = 0;
  for (const auto& p : points) distance += (p - mean).norm();
  distance /= static_cast<double>(points.size());
  if (!std::isfinite(distance) || !(distance > 0)) return std::nullopt;
  const double scale = std::sqrt(2.0) / distance;
  Eigen::Matrix3d t;
  t << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return t;
}

}  // namespace

std::optional<Eigen::Matrix3d> homography_from_points(std::span<const Eigen::Vector2d> from,
                                                      std::span<const Eigen::Vector2d> to) {
  if (from.size() != to.size() || from.size() < 4) return std::nullopt;
  const auto t_from = conditioner(from);
  const auto t_to = conditioner(to);
  if (!t_from || !t_to) return std::nullopt;

  // With the rows h1, h2, h3 of H as unknowns, F'F = [S 0 -Sx; 0 S -Sy; -Sx -Sy Sxx] with S = sum p p',
  // Sx = sum x p p', Sy = sum y p p', Sxx = sum (x^2 + y^2) p p'. Its null vector by block elimination, a 3x3
  // eigenproblem, takes a twentieth of the time of the 9x9 one.
  Eigen::Matrix3d S = Eigen::Matrix3d::Zero(), Sx = S, Sy = S, Sxx = S;
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d p = *t_from * from[i].homogeneous();
    const Eigen::Vector2d q = apply(*t_to, to[i]);
    const Eigen::Matrix3d pp = p * p.transpose();
    S += pp;
    Sx += q.x() * pp;
    Sy += q.y() * pp;
    Sxx += q.squaredNorm() * pp;
  }
  const Eigen::LLT<Eigen::Matrix3d> llt(S);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Eigen::Matrix3d of_x = llt.solve(Sx), of_y = llt.solve(Sy);
  const Eigen::Matrix3d schur = Sxx - Sx.transpose() * of_x - Sy.transpose() * of_y;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(schur);
  // One null vector, not two. The eigenvalues are squares, so 1e-12 asks for 1e-6 of the largest singular
  // value: with conditioned points good sets have 1e-2 and more, collinear ones rounding.
  if (eigen.info() != Eigen::Success || !(eigen.eigenvalues()(1) > 1e-12 * Sxx.trace())) return std::nullopt;
  const Eigen::Vector3d h3 = eigen.eigenvectors().col(0);
  Eigen::Matrix3d H;
  H << (of_x * h3).transpose(), (of_y * h3).transpose(), h3.transpose();
  H /= H.norm();
  // Three of `from` in a line that are none in `to` (or the other way round) leave one solution, a singular
  // one. A square seen at 0.1 degrees from its plane still has 1e-3.
  if (!(std::abs(H.determinant()) > 1e-9)) return std::nullopt;
  H = t_to->inverse() * H * *t_from;
  return Eigen::Matrix3d(H / H.norm());
}

}  // namespace perch
