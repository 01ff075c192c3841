#include "perch/detection/nested.h"

#include <cmath>

namespace perch {
namespace {

// The hole is 0.64 of its square's side, and half of what is in it is black. Below this side it may not be
// seen: it is 13 px, and in a blurred picture grey.
constexpr double kHoleSeenFrom = 20;  // px

// From here on it cannot be missed: the inner target's black interior, 0.36 of the square, is 14 px and
// outlasts any blooming.
constexpr double kHoleSureFrom = 40;  // px

// Boxes of pieces of one plane keep the ratio of the pieces but for perspective and a pixel of rounding.
constexpr double kRatioSlack = 1.25;

// How much larger one component's box is than another's: the mean of both sides.
double box_ratio(const Component& inner, const Component& outer) {
  const auto side = [](int low, int high) { return static_cast<double>(high - low + 1); };
  return std::sqrt(side(inner.left, inner.right) * side(inner.top, inner.bottom) /
                   (side(outer.left, outer.right) * side(outer.top, outer.bottom)));
}

bool is_about(double ratio, double expected) {
  return ratio < expected * kRatioSlack && ratio > expected / kRatioSlack;
}

// The hole, or what blooming leaves of it; what is smaller is dirt.
bool has_hole(const Segmentation& s, int square, double hole_in_square) {
  for (int label = square + 1; label < static_cast<int>(s.components.list.size()); ++label) {
    if (s.at(label).top > s.at(square).bottom) break;
    if (s.is_noise(label) || s.around(label) != square) continue;
    if (box_ratio(s.at(label), s.at(square)) > 0.5 * hole_in_square) return true;
  }
  return false;
}

// Whether the picture's edge may have cut a hole around this border.
bool is_near_edge(const Segmentation& s, const Component& border, double inner_in_hole) {
  // What is left of the hole on each side, as a part of the border; twice that for perspective.
  const double gap = 1 / inner_in_hole - 1;
  const double across = gap * (border.right - border.left + 1), down = gap * (border.bottom - border.top + 1);
  return border.left < across || border.top < down || border.right > s.image.width - 1 - across ||
         border.bottom > static_cast<double>(s.image.rows.size()) - 1 - down;
}

// Whether another white thing reaches around this border: the ring, though broken.
bool is_enclosed(const Segmentation& s, int border) {
  const Component& b = s.at(border);
  for (int label = 1; label < static_cast<int>(s.components.list.size()); ++label) {
    const Component& c = s.at(label);
    if (label == border || s.is_noise(label) || !c.white) continue;
    if (c.left <= b.left && c.right >= b.right && c.top <= b.top && c.bottom >= b.bottom) return true;
  }
  return false;
}

}  // namespace

NestedPart nested_part(const Segmentation& s, const NestedCandidate& candidate, double hole_in_square,
                       double inner_in_hole) {
  if (has_hole(s, candidate.square, hole_in_square)) return NestedPart::kOuter;
  const Component& border = s.at(candidate.border);
  // The outer one would show its hole; wherever the ring is broken, by the picture's edge or a shadow.
  if (candidate.side_px >= kHoleSureFrom) return NestedPart::kInner;
  const bool small = candidate.side_px < kHoleSeenFrom;
  const int hole = s.around(candidate.border);
  if (hole == Components::kFrame) {
    const bool alone = !is_near_edge(s, border, inner_in_hole) && !is_enclosed(s, candidate.border);
    return small && alone ? NestedPart::kOuter : NestedPart::kUnknown;
  }
  // Something black around it that is not the ground: the hole, or a dark mat on a pale floor. The ring may
  // be cut, by no more than what it has beside the hole.
  const Component& ring = s.at(s.around(hole));
  const double in_ring = box_ratio(s.at(hole), ring);
  if (is_about(box_ratio(border, s.at(hole)), inner_in_hole) && in_ring > hole_in_square / kRatioSlack) {
    return NestedPart::kInner;
  }
  const bool is_floor = in_ring < 0.5 * hole_in_square;
  return small && is_floor ? NestedPart::kOuter : NestedPart::kUnknown;
}

}  // namespace perch
