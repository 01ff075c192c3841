#include "perch/detection/corners.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// The point with the greatest value, the first of equals.
template <typename Value>
const Eigen::Vector2d& farthest(std::span<const Eigen::Vector2d> points, const Value& value) {
  const Eigen::Vector2d* best = &points[0];
  double greatest = value(points[0]);
  for (const auto& p : points.subspan(1)) {
    const double v = value(p);
    if (v > greatest) {
      greatest = v;
      best = &p;
    }
  }
  return *best;
}

// The point farthest to one side, of equals the one farther from the centre.
Eigen::Vector2d farthest_sideways(std::span<const Eigen::Vector2d> points, const Eigen::Vector2d& centre,
                                  double sign) {
  const Eigen::Vector2d* best = &points[0];
  for (const auto& p : points.subspan(1)) {
    const double further = sign * (p.x() - best->x());
    if (further > 0 || (further == 0 && (p - centre).squaredNorm() > (*best - centre).squaredNorm())) {
      best = &p;
    }
  }
  return *best;
}

// A line a -> b as the distance to its right as the picture is seen (its y points down): unit . p - offset.
struct Line {
  Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b)
      : normal(Eigen::Vector2d(a.y() - b.y(), b.x() - a.x()).normalized()), offset(normal.dot(a)) {}
  double right_of(const Eigen::Vector2d& p) const { return normal.dot(p) - offset; }
  Eigen::Vector2d normal;
  double offset;
};

}  // namespace

std::optional<std::array<Eigen::Vector2d, 4>> quad_corners(std::span<const Eigen::Vector2d> outline,
                                                           const Eigen::Vector2d& centre) {
  if (outline.size() < 4) return std::nullopt;
  const Eigen::Vector2d left = farthest_sideways(outline, centre, -1);
  const Eigen::Vector2d right = farthest_sideways(outline, centre, 1);
  const Eigen::Vector2d across = right - left;
  const Eigen::Vector2d third =
      farthest(outline, [&](const Eigen::Vector2d& p) { return std::abs(cross(across, p - left)); });
  const double turn = cross(across, third - left);
  // Zero: all in a line. A NaN is refused too.
  if (!(std::abs(turn) > 0)) return std::nullopt;

  // Counterclockwise to the eye, which is a negative turn as y points down: the outside is right of each
  // side.
  std::array<Eigen::Vector2d, 3> triangle{left, right, third};
  if (turn > 0) std::swap(triangle[1], triangle[2]);
  const std::array<Line, 3> sides{Line(triangle[0], triangle[1]), Line(triangle[1], triangle[2]),
                                  Line(triangle[2], triangle[0])};
  const auto outside = [&](const Eigen::Vector2d& p) {
    return std::max({sides[0].right_of(p), sides[1].right_of(p), sides[2].right_of(p)});
  };
  const Eigen::Vector2d fourth = farthest(outline, outside);
  size_t beyond = 0;
  for (size_t i = 1; i < 3; ++i) {
    if (sides[i].right_of(fourth) > sides[beyond].right_of(fourth)) beyond = i;
  }
  // A pixel off a side is at least 1 / length away from it, far more than rounding.
  if (!(sides[beyond].right_of(fourth) > 1e-9)) return std::nullopt;
  // It comes between the ends of the side it is beyond.
  std::array<Eigen::Vector2d, 4> corners{triangle[beyond], fourth, triangle[(beyond + 1) % 3],
                                         triangle[(beyond + 2) % 3]};
  // The diagonal through its neighbours points each corner out best. Without this the third one, where its
  // side is parallel to the line across but for a step of the raster, is anywhere along that side (one square
  // in 150 is off by 2 px and more, up to its whole side), and a speck on a side remains a corner.
  for (size_t i = 0; i < 4; ++i) {
    const Line diagonal(corners[(i + 3) % 4], corners[(i + 1) % 4]);
    corners[i] = farthest(outline, [&](const Eigen::Vector2d& p) { return diagonal.right_of(p); });
  }
  return corners;
}

}  // namespace perch
