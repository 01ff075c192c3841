#include "perch/simulation/patch_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace perch {

namespace {

// Along the longer side. More cells answer more areas near an edge but take longer to fill: 1024 take 10 ms.
constexpr int kCells = 1024;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// How far p is left of the line from a to b, times its length.
double left_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& p) {
  return cross(b - a, p - a);
}

}  // namespace

// A convex polygon. It has at most one side for each outward normal: 4 of the pixel and 4 of each direction
// in which patches lie, so 32 are enough for a pixel that sees seven tags turned by seven angles.
struct PatchMap::Polygon {
  std::array<Eigen::Vector2d, 32> p;
  size_t n = 0;

  void add(const Eigen::Vector2d& point) {
    if (n < p.size()) p[n++] = point;
  }
  double area() const {
    double twice = 0;
    for (size_t i = 2; i < n; ++i) twice += cross(p[i - 1] - p[0], p[i] - p[0]);
    return std::abs(twice) / 2;
  }
  // Cuts by the line from a to b.
  void split(const Eigen::Vector2d& a, const Eigen::Vector2d& b, Polygon& left, Polygon& right) const {
    left.n = right.n = 0;
    for (size_t i = 0; i < n; ++i) {
      const Eigen::Vector2d &from = p[i], &to = p[i + 1 < n ? i + 1 : 0];
      const double s = left_of(a, b, from), t = left_of(a, b, to);
      if (s >= 0) left.add(from);
      if (s <= 0) right.add(from);
      if ((s > 0 && t < 0) || (s < 0 && t > 0)) {
        const Eigen::Vector2d crossing = from + s / (s - t) * (to - from);
        left.add(crossing);
        right.add(crossing);
      }
    }
  }
  bool right_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
    for (size_t i = 0; i < n; ++i) {
      if (left_of(a, b, p[i]) > 0) return false;
    }
    return true;
  }
};

PatchMap::PatchMap(std::span<const Patch> patches) {
  for (const Patch& patch : patches) {
    Painted painted{patch.corners, patch.corners[0], patch.corners[0], patch.white};
    if (left_of(patch.corners[0], patch.corners[1], patch.corners[2]) < 0) {
      std::reverse(painted.corners.begin(), painted.corners.end());
    }
    for (const auto& corner : patch.corners) {
      painted.low = painted.low.cwiseMin(corner);
      painted.high = painted.high.cwiseMax(corner);
    }
    patches_.push_back(painted);
  }
  rasterise();
}

void PatchMap::rasterise() {
  if (patches_.empty()) return;
  low_ = patches_[0].low;
  high_ = patches_[0].high;
  for (const auto& patch : patches_) {
    low_ = low_.cwiseMin(patch.low);
    high_ = high_.cwiseMax(patch.high);
  }
  cell_ = (high_ - low_).maxCoeff() / kCells;
  const Eigen::Vector2d origin = low_;
  const Eigen::Vector2d size = high_ - low_;
  columns_ = static_cast<int>(std::ceil(size.x() / cell_)) + 1;
  rows_ = static_cast<int>(std::ceil(size.y() / cell_)) + 1;
  cells_.resize(static_cast<size_t>(columns_) * static_cast<size_t>(rows_));

  cv::Mat_<uint8_t> free_of_edges(rows_, columns_, uint8_t{1});
  const auto column = [&](double x) {
    return std::clamp(static_cast<int>((x - origin.x()) / cell_), 0, columns_ - 1);
  };
  const auto row = [&](double y) {
    return std::clamp(static_cast<int>((y - origin.y()) / cell_), 0, rows_ - 1);
  };
  for (const auto& patch : patches_) {
    // Later over earlier, by the cells' centres: those with an edge in them are never asked.
    for (int r = row(patch.low.y()); r <= row(patch.high.y()); ++r) {
      for (int c = column(patch.low.x()); c <= column(patch.high.x()); ++c) {
        const Eigen::Vector2d centre = origin + cell_ * Eigen::Vector2d(c + 0.5, r + 0.5);
        bool inside = true;
        for (size_t k = 0; k < 4; ++k) {
          inside = inside && left_of(patch.corners[k], patch.corners[(k + 1) % 4], centre) >= 0;
        }
        if (!inside) continue;
        Cell& cell = cells_[static_cast<size_t>(r * columns_ + c)];
        cell.white = patch.white ? 1 : 0;
        cell.black = patch.white ? 0 : 1;
      }
    }
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d &a = patch.corners[k], &b = patch.corners[(k + 1) % 4];
      const int steps = static_cast<int>(std::ceil((b - a).norm() / cell_ * 4)) + 1;
      for (int i = 0; i <= steps; ++i) {
        const Eigen::Vector2d point = a + static_cast<double>(i) / steps * (b - a);
        free_of_edges(row(point.y()), column(point.x())) = 0;
      }
    }
  }

  // Every point of an edge is within 1/8 cell of a sample, every sample within sqrt(1/2) of its cell's
  // centre, and so is the point that is asked for: together 1.54 cells between the distance of centres and
  // that of points.
  cv::Mat_<float> distance;
  cv::distanceTransform(free_of_edges, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  for (size_t i = 0; i < cells_.size(); ++i) {
    cells_[i].clearance = static_cast<float>((distance(static_cast<int>(i)) - 1.55) * cell_);
  }
}

std::optional<Coverage> PatchMap::uniform(const Eigen::Vector2d& point, double radius) const {
  const Eigen::Vector2d outside = (low_ - point).cwiseMax(point - high_);
  if (patches_.empty() || outside.maxCoeff() > radius) return Coverage{};
  const int c = static_cast<int>((point.x() - low_.x()) / cell_),
            r = static_cast<int>((point.y() - low_.y()) / cell_);
  if (outside.maxCoeff() > 0 || c >= columns_ || r >= rows_) return std::nullopt;
  const Cell& cell = cells_[static_cast<size_t>(r * columns_ + c)];
  if (!(cell.clearance > radius)) return std::nullopt;
  return Coverage{cell.white, cell.black};
}

Coverage PatchMap::mean(const Quad& area) const {
  Polygon polygon;
  for (const auto& corner : area) polygon.add(corner);
  Coverage areas;
  const double whole = polygon.area();
  if (!(whole > 0)) return areas;
  paint(polygon, patches_.size(), 1e-12 * whole, areas);
  return {areas.white / whole, areas.black / whole};
}

// Adds what of a polygon the patches below number `above` show, from the top down: what lies in a patch has
// its colour, and the pieces cut off by its sides see those beneath. Exact whatever overlaps what.
void PatchMap::paint(const Polygon& polygon, size_t above, double smallest, Coverage& areas) const {
  Eigen::Vector2d low = polygon.p[0], high = polygon.p[0];
  for (size_t i = 1; i < polygon.n; ++i) {
    low = low.cwiseMin(polygon.p[i]);
    high = high.cwiseMax(polygon.p[i]);
  }
  while (above-- > 0) {
    const Painted& patch = patches_[above];
    if (patch.high.x() <= low.x() || patch.low.x() >= high.x() || patch.high.y() <= low.y() ||
        patch.low.y() >= high.y()) {
      continue;
    }
    const Quad& q = patch.corners;
    if (polygon.right_of(q[0], q[1]) || polygon.right_of(q[1], q[2]) || polygon.right_of(q[2], q[3]) ||
        polygon.right_of(q[3], q[0])) {
      continue;
    }
    Polygon inside = polygon, left, right;
    for (size_t k = 0; k < 4; ++k) {
      inside.split(q[k], q[(k + 1) % 4], left, right);
      if (right.n >= 3 && right.area() > smallest) paint(right, above, smallest, areas);
      inside = left;
    }
    if (inside.n >= 3) (patch.white ? areas.white : areas.black) += inside.area();
    return;
  }
}

}  // namespace perch
