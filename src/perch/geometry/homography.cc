#include "perch/geometry/homography.h"

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

  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d p = *t_from * from[i].homogeneous();
    const Eigen::Vector2d q = apply(*t_to, to[i]);
    Eigen::Matrix<double, 2, 9> rows;
    rows << p.transpose(), Eigen::RowVector3d::Zero(), -q.x() * p.transpose(),  //
        Eigen::RowVector3d::Zero(), p.transpose(), -q.y() * p.transpose();
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(normal);
  // Rank 8 is needed for one solution. The eigenvalues are squares, so 1e-12 asks for 1e-6 of the largest
  // singular value: with conditioned points good sets have 1e-2 and more, collinear ones rounding.
  if (!(eigen.eigenvalues()(1) > 1e-12 * eigen.eigenvalues()(8))) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = eigen.eigenvectors().col(0);
  Eigen::Matrix3d H;
  H << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(), h.segment<3>(6).transpose();
  // Three of `from` in a line that are none in `to` (or the other way round) leave one solution, a singular
  // one. A square seen at 0.1 degrees from its plane still has 1e-3.
  if (!(std::abs(H.determinant()) > 1e-9)) return std::nullopt;
  H = t_to->inverse() * H * *t_from;
  return Eigen::Matrix3d(H / H.norm());
}

}  // namespace perch
