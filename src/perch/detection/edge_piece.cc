#include "perch/detection/edge_piece.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace perch {
namespace {

struct Seen {
  Eigen::Vector2d image, pixel;
};

std::optional<Seen> see(const Eigen::Matrix3d& H, const CameraModel& camera, const Eigen::Vector2d& q,
                        Matrix23d* by_point) {
  const Eigen::Vector3d p = H * q.homogeneous();
  if (!(p.z() > 0)) return std::nullopt;
  const Eigen::Vector2d image = p.hnormalized();
  const auto pixel = camera.pixel_from_camera(image.homogeneous(), by_point);
  if (!pixel) return std::nullopt;
  return Seen{image, *pixel};
}

}  // namespace

Eigen::Matrix3d towards_camera(const Eigen::Matrix3d& image_from_plane) {
  return image_from_plane(2, 2) < 0 ? Eigen::Matrix3d(-image_from_plane) : image_from_plane;
}

void project_edges(const TargetEdges& target, const Eigen::Matrix3d& image_from_plane,
                   const CameraModel& camera, double longest, std::vector<EdgePiece>& pieces) {
  pieces.clear();
  const Eigen::Matrix3d& H = image_from_plane;
  const auto in_picture = [&](const Eigen::Vector2d& p) {
    return p.x() >= 0 && p.y() >= 0 && p.x() <= camera.width() - 1 && p.y() <= camera.height() - 1;
  };
  std::optional<Seen> last_end;
  for (size_t i = 0; i < target.edges.size(); ++i) {
    const TargetEdge& edge = target.edges[i];
    const auto at = [&](double t) -> Eigen::Vector2d { return edge.from + t * (edge.to - edge.from); };
    // Around a shape each edge begins where the last one ended.
    const bool goes_on = i > 0 && target.edges[i - 1].to == edge.from;
    const auto from = goes_on ? last_end : see(H, camera, edge.from, nullptr);
    const auto to = see(H, camera, edge.to, nullptr);
    last_end = to;
    // An end that the lens cannot show: its edge is cut by the picture's edge and seen in pieces.
    const double length = from && to ? (to->pixel - from->pixel).norm() : 8 * std::min(longest, 100.0);
    int count = static_cast<int>(std::ceil(length / longest));
    if (length > 24 && longest < kWhole) count = std::max(count, 2);
    count = std::clamp(count, 1, 12);
    std::optional<Seen> begin = from;
    for (int k = 0; k < count; ++k) {
      const auto end = k + 1 == count ? to : see(H, camera, at((k + 1.0) / count), nullptr);
      const Eigen::Vector2d q = at((k + 0.5) / count);
      Matrix23d by_point;
      const auto middle = begin && end ? see(H, camera, q, &by_point) : std::nullopt;
      if (middle && (in_picture(middle->pixel) || in_picture(begin->pixel) || in_picture(end->pixel))) {
        EdgePiece piece;
        piece.edge = static_cast<int>(i);
        piece.image = middle->image;
        piece.begin = begin->pixel;
        piece.middle = middle->pixel;
        piece.end = end->pixel;
        const double w = H.row(2).dot(q.homogeneous());
        const Eigen::Matrix2d by_q = (H.topLeftCorner<2, 2>() - middle->image * H.row(2).head<2>()) / w;
        const Eigen::Vector2d across = by_point.leftCols<2>() * by_q * edge.normal;
        const Eigen::Vector2d along = piece.end - piece.begin;
        piece.normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
        if (piece.normal.dot(across) < 0) piece.normal = -piece.normal;
        piece.gradient = by_point.leftCols<2>().transpose() * piece.normal;
        const double px_per_m = piece.normal.dot(across);
        piece.white_room = edge.white_room * px_per_m;
        piece.black_room = edge.black_room * px_per_m;
        piece.first = k == 0;
        piece.last = k + 1 == count;
        if (along.squaredNorm() > 1e-6 && piece.normal.allFinite()) pieces.push_back(piece);
      }
      begin = end;
    }
  }
}

CrossingLines::CrossingLines(const EdgePiece& piece, double trim) {
  rows_ = std::abs(piece.normal.x()) >= std::abs(piece.normal.y());
  const int along = rows_ ? 1 : 0, across = 1 - along;
  begin_ = piece.begin[along];
  start_ = piece.begin[across];
  run_ = piece.end[across] - start_;
  const double span = piece.end[along] - begin_;
  per_line_ = 1 / span;
  // Where the arc is at the middle's own line, from the chord.
  const double u = (piece.middle[along] - begin_) * per_line_;
  bend_ = (piece.middle[across] - start_ - u * run_) / std::max(u * (1 - u), 0.1);
  along_normal_ = piece.normal[across];
  const double cut = trim * std::abs(span) / piece.length();
  double low = begin_ + (piece.first ? std::copysign(cut, span) : 0);
  double high = piece.end[along] - (piece.last ? std::copysign(cut, span) : 0);
  if (span < 0) std::swap(low, high);
  first_ = static_cast<int>(std::ceil(low));
  last_ = static_cast<int>(std::ceil(high)) - 1;
}

}  // namespace perch
