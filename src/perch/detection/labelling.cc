#include "perch/detection/labelling.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/euler.h"

namespace perch {
namespace {

// Vectors closer in direction than this are one ray: `sharp` has none other closer than 0.2 from its anchor
// down to tilts of 75 degrees, and half a pixel of error in a centre 8 px away turns it by 0.06.
constexpr double kSameRay = 0.1;  // rad

// Two squares are at least a gap apart, which is a pixel or they were one; closer, one was seen twice.
constexpr double kSamePlace = 1;  // px

// The centres in a plane with y up.
struct Points {
  std::array<Eigen::Vector2d, Labelling::kMaxSquares> at;
  size_t count = 0;

  void add(const Eigen::Vector2d& p) { at[count++] = p; }
  std::span<const Eigen::Vector2d> all() const { return {at.data(), count}; }
};

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

double angle_of(const Eigen::Vector2d& v) { return std::atan2(v.y(), v.x()); }

// From a counterclockwise to b, [0, 2 pi).
double turn(double a, double b) {
  const double t = wrap_angle(b - a);
  return t < 0 ? t + 2 * M_PI : t;
}

// How far the best two disjoint pairs of vectors from `from` are off being collinear: the larger sine of the
// two.
double two_pairs_off_line(const Points& centres, size_t from) {
  Points rays;
  for (const auto& p : centres.all()) {
    if (&p != &centres.at[from]) rays.add((p - centres.at[from]).normalized());
  }
  double best = 1;
  const auto off = [&](size_t i, size_t j) { return std::abs(cross(rays.at[i], rays.at[j])); };
  for (size_t i = 0; i < rays.count; ++i) {
    for (size_t j = i + 1; j < rays.count; ++j) {
      const double first = off(i, j);
      if (first >= best) continue;
      for (size_t k = i + 1; k < rays.count; ++k) {
        for (size_t l = k + 1; l < rays.count; ++l) {
          if (k != j && l != j) best = std::min(best, std::max(first, off(k, l)));
        }
      }
    }
  }
  return best;
}

struct Anchor {
  size_t square = 0;
  double off_line = 2;
};

Anchor anchor_of(const Points& centres) {
  Anchor anchor;
  for (size_t i = 0; i < centres.count; ++i) {
    const double off = two_pairs_off_line(centres, i);
    if (off < anchor.off_line) anchor = {i, off};
  }
  return anchor;
}

// A square other than the anchor, as seen from it.
struct Around {
  double angle = 0, distance = 0;
  size_t square = 0;
};
struct Order {
  std::array<Around, Labelling::kMaxSquares> at;
  size_t count = 0;
};

// The others around `anchor`, counterclockwise from the widest gap between them.
Order order_around(const Points& centres, size_t anchor) {
  Order order;
  for (size_t i = 0; i < centres.count; ++i) {
    const Eigen::Vector2d v = centres.at[i] - centres.at[anchor];
    if (i != anchor) order.at[order.count++] = {angle_of(v), v.norm(), i};
  }
  const auto begin = order.at.begin();
  const auto end = begin + static_cast<std::ptrdiff_t>(order.count);
  std::sort(begin, end, [](const Around& a, const Around& b) { return a.angle < b.angle; });
  auto start = begin;
  double widest = 0;
  for (auto it = begin; it != end; ++it) {
    const double gap = turn((it == begin ? end : it)[-1].angle, it->angle);
    if (gap > widest) {
      widest = gap;
      start = it;
    }
  }
  std::rotate(begin, start, end);
  return order;
}

// The nearest first, of the `count` from `first` on, which lie on one ray.
void sort_by_distance(Order& order, size_t first, size_t count) {
  const auto begin = order.at.begin() + static_cast<std::ptrdiff_t>(first);
  std::sort(begin, begin + static_cast<std::ptrdiff_t>(count),
            [](const Around& a, const Around& b) { return a.distance < b.distance; });
}

// The index of the corner that comes first counterclockwise from the direction centre -> towards: that
// direction lies between it and the corner before it. They are in counterclockwise order.
size_t first_corner(const std::array<Eigen::Vector2d, 4>& corners, const Eigen::Vector2d& centre,
                    const Eigen::Vector2d& towards) {
  const Eigen::Vector2d reference = towards - centre;
  for (size_t i = 0; i < 4; ++i) {
    if (cross(corners[(i + 3) % 4] - centre, reference) > 0 && cross(reference, corners[i] - centre) >= 0) {
      return i;
    }
  }
  return 0;  // the centre is not inside the corners
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

bool two_at_one_place(const Points& centres) {
  for (size_t i = 0; i < centres.count; ++i) {
    for (size_t j = i + 1; j < centres.count; ++j) {
      if (!((centres.at[i] - centres.at[j]).squaredNorm() >= kSamePlace * kSamePlace)) return true;
    }
  }
  return false;
}

}  // namespace

std::optional<Labelling> Labelling::of(const SquaresLayout& layout) {
  if (layout.squares.size() < 5 || layout.squares.size() > kMaxSquares) return std::nullopt;
  Points centres;
  for (const auto& s : layout.squares) centres.add(s.lower_left + Eigen::Vector2d::Constant(s.side / 2));
  const Anchor anchor = anchor_of(centres);
  // The drawing is exact: what is collinear is so to rounding, what is not differs by more than what is seen
  // can hide.
  if (anchor.off_line > 1e-9) return std::nullopt;
  for (size_t i = 0; i < centres.count; ++i) {
    if (i != anchor.square && two_pairs_off_line(centres, i) < kSameRay) return std::nullopt;
  }
  Labelling labelling;
  labelling.anchor_ = anchor.square;
  Order order = order_around(centres, anchor.square);
  if (turn(order.at[0].angle, order.at[order.count - 1].angle) > M_PI - kSameRay) {
    return std::nullopt;  // no gap of half a turn: perspective could move the widest gap
  }
  for (size_t first = 0; first < order.count;) {
    size_t count = 1;
    while (first + count < order.count &&
           turn(order.at[first].angle, order.at[first + count].angle) < kSameRay) {
      ++count;
    }
    sort_by_distance(order, first, count);
    labelling.rays_.push_back(count);
    first += count;
  }
  for (size_t i = 0; i < order.count; ++i) labelling.order_.push_back(order.at[i].square);

  for (size_t i = 0; i < centres.count; ++i) {
    const Quad corners = square_corners(layout.squares[i].lower_left, layout.squares[i].side);
    size_t best = i == 0 ? 1 : 0;
    for (size_t k = 0; k < centres.count; ++k) {
      if (k != i && least_margin(corners, centres.at[i], centres.at[k]) >
                        least_margin(corners, centres.at[i], centres.at[best])) {
        best = k;
      }
    }
    labelling.corner_rules_.push_back({best, first_corner(corners, centres.at[i], centres.at[best])});
  }
  return labelling;
}

bool Labelling::label(std::span<const SeenSquare> seen, std::vector<SeenSquare>& labelled) const {
  labelled.clear();
  const size_t n = corner_rules_.size();
  if (seen.size() != n) return false;
  Points centres;
  for (const auto& s : seen) centres.add(turned_over(s.centre));
  if (two_at_one_place(centres)) return false;
  const Anchor anchor = anchor_of(centres);
  if (!(anchor.off_line <= kSameRay)) return false;
  Order order = order_around(centres, anchor.square);
  size_t first_on_ray = 0;
  for (const size_t count : rays_) {
    const size_t last = first_on_ray + count - 1;
    if (turn(order.at[first_on_ray].angle, order.at[last].angle) > kSameRay) return false;
    // All in one line have pairs in line too.
    const bool more = last + 1 < order.count;
    if (more && turn(order.at[last].angle, order.at[last + 1].angle) < kSameRay) return false;
    sort_by_distance(order, first_on_ray, count);
    first_on_ray += count;
  }

  std::array<size_t, kMaxSquares> seen_of;  // by the layout's order
  seen_of[anchor_] = anchor.square;
  for (size_t i = 0; i < order.count; ++i) seen_of[order_[i]] = order.at[i].square;
  for (size_t i = 0; i < n; ++i) {
    const SeenSquare& square = seen[seen_of[i]];
    std::array<Eigen::Vector2d, 4> corners;
    std::transform(square.corners.begin(), square.corners.end(), corners.begin(), turned_over);
    const auto& [towards, first_feature] = corner_rules_[i];
    const size_t first = first_corner(corners, centres.at[seen_of[i]], centres.at[seen_of[towards]]);
    labelled.push_back(square);
    for (size_t k = 0; k < 4; ++k) {
      labelled.back().corners[(first_feature + k) % 4] = square.corners[(first + k) % 4];
    }
  }
  return true;
}

}  // namespace perch
