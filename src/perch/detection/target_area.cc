#include "perch/detection/target_area.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <ranges>

namespace perch {
namespace {

// What the raster does to a region's corners.
constexpr double kCornerSlack = 1.5;  // px

}  // namespace

TargetArea::TargetArea(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera,
                       const Confirmed& found)
    : edges_(edges),
      camera_(camera),
      found_(found),
      size_(target.size),
      smallest_(target.size),
      plane_from_image_(found.image_from_plane.inverse()) {
  for (const TargetShape& shape : edges.shapes) {
    if (shape.inner) continue;
    if (shape.kind == ShapeKind::kInterior) interior_ = shape.side;
    if (shape.kind == ShapeKind::kSquare) smallest_ = std::min(smallest_, shape.side);
  }
  const Eigen::Matrix3d& H = found.image_from_plane;
  for (const Eigen::Vector2d& corner : square_corners(Eigen::Vector2d::Constant(-0.5 * size_), size_)) {
    const Eigen::Vector3d p = H * corner.homogeneous();
    const auto pixel = p.z() > 0 ? camera.pixel_from_camera(p) : std::nullopt;
    // A corner that the lens cannot show may be anywhere.
    if (!pixel) box_.extend(Eigen::Vector2d(-1e6, -1e6)).extend(Eigen::Vector2d(1e6, 1e6));
    if (pixel) box_.extend(*pixel);
  }
  // A lens may bend the sides outwards.
  const Eigen::Vector2d bulge = 0.1 * box_.sizes();
  box_ = Eigen::AlignedBox2d(box_.min() - bulge, box_.max() + bulge);
  const Eigen::Vector2d centre = H.col(2).hnormalized();
  const Eigen::Matrix2d by_q = (H.topLeftCorner<2, 2>() - centre * H.row(2).head<2>()) / H(2, 2);
  px2_per_m2_ = std::pow(camera.intrinsics()[0], 2) * std::abs(by_q.determinant());
  px_ = 1 / (camera.intrinsics()[0] * Eigen::JacobiSVD<Eigen::Matrix2d>(by_q).singularValues()(1));
}

std::optional<Eigen::Vector2d> TargetArea::on_plane(const Eigen::Vector2d& pixel) const {
  const auto ray = camera_.ray_from_pixel(pixel);
  if (!ray) return std::nullopt;
  const Eigen::Vector3d q = plane_from_image_ * *ray;
  if (!(std::abs(q.z()) > 0)) return std::nullopt;
  return q.hnormalized();
}

bool TargetArea::holds(const Eigen::Vector2d& pixel) const {
  if (!box_.contains(pixel)) return false;
  const auto q = on_plane(pixel);
  return q && q->cwiseAbs().maxCoeff() < 0.5 * size_;
}

bool TargetArea::is_hidden(size_t shape) const {
  return edges_.shapes[shape].kind == ShapeKind::kSquare && !edges_.shapes[shape].inner &&
         !found_.seen[shape];
}

bool TargetArea::is_stranger(const WhiteQuad& quad) const {
  if (!quad.four_sided || !box_.contains(quad.seen.centre)) return false;
  std::array<Eigen::Vector2d, 4> corners;
  for (size_t k = 0; k < 4; ++k) {
    const auto corner = on_plane(quad.seen.corners[k]);
    if (!corner || !(corner->cwiseAbs().maxCoeff() < 0.5 * interior_)) return false;
    corners[k] = *corner;
  }
  const double side =
      0.5 * ((corners[0] - corners[2]).norm() + (corners[1] - corners[3]).norm()) / std::sqrt(2.0);
  if (side < 0.6 * smallest_) return false;
  // What a raster does to corners is more than it seems where the squares are small.
  const double slack = std::max(0.3 * smallest_, kCornerSlack * px_);
  const auto shapes = std::views::iota(size_t{0}, edges_.shapes.size());
  const auto on_shape = [&](size_t i) {
    const TargetShape& shape = edges_.shapes[i];
    if (shape.kind != ShapeKind::kSquare && !shape.inner) return false;
    return std::ranges::all_of(corners, [&](const Eigen::Vector2d& c) {
      return (c - shape.centre).cwiseAbs().maxCoeff() < 0.5 * shape.side + slack;
    });
  };
  if (std::ranges::any_of(shapes, on_shape)) return false;
  // What covers a square: with all others in sight, or two at once. Another panel's square does neither.
  const Eigen::Vector2d centre = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
  const auto touches = [&](size_t i) {
    return is_hidden(i) &&
           (centre - edges_.shapes[i].centre).cwiseAbs().maxCoeff() < 0.5 * (edges_.shapes[i].side + side);
  };
  const auto hides = [&](size_t i) {
    return is_hidden(i) && (centre - edges_.shapes[i].centre).norm() < 0.5 * side;
  };
  const auto hidden = std::ranges::count_if(shapes, [&](size_t i) { return is_hidden(i); });
  return !(hidden == 1 ? std::ranges::any_of(shapes, touches) : std::ranges::count_if(shapes, hides) >= 2);
}

bool TargetArea::is_beside(const WhiteQuad& quad) const {
  if (!box_.contains(quad.seen.centre)) return false;
  const auto centre = on_plane(quad.seen.centre);
  if (!centre) return false;
  for (const TargetShape& shape : edges_.shapes) {
    if (shape.kind != ShapeKind::kSquare || shape.inner) continue;
    const double off = (*centre - shape.centre).norm();
    if (off > 0.75 * shape.side) continue;
    const double part = quad.side_px * quad.side_px / (shape.side * shape.side * px2_per_m2_);
    return part > 0.6 && part < 1.7 && off > 0.2 * shape.side + 0.3 * px_;
  }
  return false;
}

std::optional<size_t> TargetArea::piece_of(const WhiteQuad& quad) const {
  if (!quad.four_sided || !box_.contains(quad.seen.centre)) return std::nullopt;
  const auto centre = on_plane(quad.seen.centre);
  const auto corner = on_plane(quad.seen.corners[0]);
  if (!centre || !corner) return std::nullopt;
  for (size_t i = 0; i < edges_.shapes.size(); ++i) {
    const TargetShape& shape = edges_.shapes[i];
    if (!is_hidden(i) || (*centre - shape.centre).cwiseAbs().maxCoeff() > 0.5 * shape.side) continue;
    if (M_SQRT2 * (*corner - *centre).norm() < 0.7 * shape.side) return i;
  }
  return std::nullopt;
}

}  // namespace perch
