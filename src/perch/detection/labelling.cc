#include "perch/detection/labelling.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "perch/geometry/euler.h"

namespace perch {
namespace {

using Points = std::vector<Eigen::Vector2d>;

// Vectors closer in direction than this are one ray: `sharp` has none other closer than 0.2 at its squares,
// and half a pixel of error in a centre 8 px away turns it by 0.06.
constexpr double kSameRay = 0.1;  // rad

double angle_of(const Eigen::Vector2d& v) { return std::atan2(v.y(), v.x()); }

// From a counterclockwise to b, [0, 2 pi).
double turn(double a, double b) {
  const double t = wrap_angle(b - a);
  return t < 0 ? t + 2 * M_PI : t;
}

// How far the best two disjoint pairs of vectors from `from` are off being collinear: the larger sine of the
// two.
double two_pairs_off_line(const Points& centres, size_t from) {
  const size_t n = centres.size();
  const auto off = [&](size_t i, size_t j) {
    const Eigen::Vector2d a = (centres[i] - centres[from]).normalized();
    const Eigen::Vector2d b = (centres[j] - centres[from]).normalized();
    return std::abs(a.x() * b.y() - a.y() * b.x());
  };
  double best = 1;
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n; ++j) {
      if (i == from || j == from) continue;
      const double first = off(i, j);
      if (first >= best) continue;
      for (size_t k = i + 1; k < n; ++k) {
        for (size_t l = k + 1; l < n; ++l) {
          if (k == j || l == j || k == from || l == from) continue;
          best = std::min(best, std::max(first, off(k, l)));
        }
      }
    }
  }
  return best;
}

size_t anchor_of(const Points& centres) {
  size_t anchor = 0;
  double least = 2;
  for (size_t i = 0; i < centres.size(); ++i) {
    const double off = two_pairs_off_line(centres, i);
    if (off < least) {
      least = off;
      anchor = i;
    }
  }
  return anchor;
}

// The others around `anchor`, counterclockwise from the widest gap between them; on one ray the nearest
// first.
std::vector<int> order_around(const Points& centres, size_t anchor) {
  std::vector<std::pair<double, int>> angles;
  for (size_t i = 0; i < centres.size(); ++i) {
    if (i != anchor) angles.emplace_back(angle_of(centres[i] - centres[anchor]), static_cast<int>(i));
  }
  std::sort(angles.begin(), angles.end());
  size_t start = 0;
  double widest = 0;
  for (size_t i = 0; i < angles.size(); ++i) {
    const double gap = turn(angles[(i + angles.size() - 1) % angles.size()].first, angles[i].first);
    if (gap > widest) {
      widest = gap;
      start = i;
    }
  }
  std::rotate(angles.begin(), angles.begin() + static_cast<std::ptrdiff_t>(start), angles.end());

  const auto distance = [&](int i) { return (centres[static_cast<size_t>(i)] - centres[anchor]).norm(); };
  std::vector<int> order;
  for (size_t i = 0; i < angles.size();) {
    size_t end = i + 1;
    while (end < angles.size() && turn(angles[i].first, angles[end].first) < kSameRay) ++end;
    for (size_t k = i; k < end; ++k) order.push_back(angles[k].second);
    std::sort(order.begin() + static_cast<std::ptrdiff_t>(i), order.end(),
              [&](int a, int b) { return distance(a) < distance(b); });
    i = end;
  }
  return order;
}

// The index of the corner that comes first counterclockwise from the direction centre -> towards.
size_t first_corner(const std::array<Eigen::Vector2d, 4>& corners, const Eigen::Vector2d& centre,
                    const Eigen::Vector2d& towards) {
  const double reference = angle_of(towards - centre);
  size_t first = 0;
  for (size_t i = 1; i < 4; ++i) {
    if (turn(reference, angle_of(corners[i] - centre)) < turn(reference, angle_of(corners[first] - centre))) {
      first = i;
    }
  }
  return first;
}

// How near the reference direction comes to a corner's: nearer, and noise could change which corner is first.
double least_margin(const std::array<Eigen::Vector2d, 4>& corners, const Eigen::Vector2d& centre,
                    const Eigen::Vector2d& towards) {
  double margin = M_PI;
  for (const auto& corner : corners) {
    margin = std::min(margin, std::abs(wrap_angle(angle_of(corner - centre) - angle_of(towards - centre))));
  }
  return margin;
}

// The picture's y points down, the face's up: turned over, counterclockwise means the same in both.
Eigen::Vector2d turned_over(const Eigen::Vector2d& pixel) { return {pixel.x(), -pixel.y()}; }

}  // namespace

std::optional<Labelling> Labelling::of(const SquaresLayout& layout) {
  Points centres;
  for (const auto& s : layout.squares)
    centres.push_back(s.lower_left + Eigen::Vector2d::Constant(s.side / 2));
  if (centres.size() < 5) return std::nullopt;
  const size_t anchor = anchor_of(centres);
  // The drawing is exact: what is collinear is so to rounding, what is not differs by more than what is seen
  // can hide.
  if (two_pairs_off_line(centres, anchor) > 1e-9) return std::nullopt;
  for (size_t i = 0; i < centres.size(); ++i) {
    if (i != anchor && two_pairs_off_line(centres, i) < kSameRay) return std::nullopt;
  }
  Labelling labelling;
  labelling.anchor_ = static_cast<int>(anchor);
  labelling.order_ = order_around(centres, anchor);
  const auto direction = [&](int i) { return angle_of(centres[static_cast<size_t>(i)] - centres[anchor]); };
  if (turn(direction(labelling.order_.front()), direction(labelling.order_.back())) > M_PI - kSameRay) {
    return std::nullopt;  // no gap of half a turn: perspective could move the widest gap
  }

  for (size_t i = 0; i < centres.size(); ++i) {
    const Quad corners = square_corners(layout.squares[i].lower_left, layout.squares[i].side);
    size_t best = i == 0 ? 1 : 0;
    for (size_t k = 0; k < centres.size(); ++k) {
      if (k == i) continue;
      if (least_margin(corners, centres[i], centres[k]) > least_margin(corners, centres[i], centres[best]))
        best = k;
    }
    labelling.corner_rules_.push_back(
        {static_cast<int>(best), static_cast<int>(first_corner(corners, centres[i], centres[best]))});
  }
  return labelling;
}

std::optional<std::vector<SeenSquare>> Labelling::label(std::span<const SeenSquare> seen) const {
  const size_t n = corner_rules_.size();
  if (seen.size() != n) return std::nullopt;
  Points centres;
  for (const auto& s : seen) centres.push_back(turned_over(s.centre));
  const size_t anchor = anchor_of(centres);
  if (two_pairs_off_line(centres, anchor) > kSameRay) return std::nullopt;
  const std::vector<int> order = order_around(centres, anchor);

  std::vector<size_t> seen_of(n);  // by the layout's order
  seen_of[static_cast<size_t>(anchor_)] = anchor;
  for (size_t i = 0; i < order.size(); ++i) {
    seen_of[static_cast<size_t>(order_[i])] = static_cast<size_t>(order[i]);
  }
  std::vector<SeenSquare> labelled;
  for (size_t i = 0; i < n; ++i) {
    const SeenSquare& square = seen[seen_of[i]];
    std::array<Eigen::Vector2d, 4> corners;
    std::transform(square.corners.begin(), square.corners.end(), corners.begin(), turned_over);
    const size_t towards = seen_of[static_cast<size_t>(corner_rules_[i].towards)];
    const size_t first = first_corner(corners, centres[seen_of[i]], centres[towards]);
    SeenSquare out{square.centre, {}};
    for (size_t k = 0; k < 4; ++k) {
      out.corners[(static_cast<size_t>(corner_rules_[i].first) + k) % 4] = square.corners[(first + k) % 4];
    }
    labelled.push_back(out);
  }
  return labelled;
}

}  // namespace perch
