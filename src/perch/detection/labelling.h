#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "perch/target/landing_target.h"

namespace perch {

// A square as it was seen: its centre of gravity and its corners, counterclockwise to the eye, in pixels.
struct SeenSquare {
  Eigen::Vector2d centre;
  std::array<Eigen::Vector2d, 4> corners;
  int component = 0;  // which it is to the caller; no label depends on it
};

// The paper's section 2.1.4. A camera in front of the face keeps the sense of rotation of any three points
// (proposition 1), so the squares are told by their order around one of them, the anchor (D of `sharp`):
// the only square whose vectors to the others hold two pairs of collinear ones. The others follow
// counterclockwise by angle, collinear ones by distance. In each square, one corner comes first
// counterclockwise from the direction to another square; the rest follow it.
//
// What is peculiar to `sharp` (which square, which order) is read off the layout, so that every layout with
// such an anchor, seen by all others within half a turn, can be labelled.
class Labelling {
 public:
  // More squares than any layout has; it lets a frame be labelled without allocating.
  static constexpr size_t kMaxSquares = 16;

  // Empty when the layout has no such anchor, fewer than five squares or more than kMaxSquares.
  static std::optional<Labelling> of(const SquaresLayout& layout);

  // Puts the seen squares into the layout's order, each with its corners in the order of its features. False,
  // and `labelled` is empty, when their number is wrong, two are at one place, no square can be the anchor,
  // or the others do not stand around it as they should. A picture of the mirrored target is labelled as if
  // it were none: the layout is symmetric about the line from D to A but for the sense of rotation.
  bool label(std::span<const SeenSquare> seen, std::vector<SeenSquare>& labelled) const;

 private:
  struct CornerRule {
    size_t towards = 0;  // the square whose direction is the reference
    size_t first = 0;    // the feature (0..3) that comes first counterclockwise from it
  };
  size_t anchor_ = 0;
  std::vector<size_t> order_;             // the other squares as they come around the anchor
  std::vector<size_t> rays_;              // how many of them lie on each ray from it
  std::vector<CornerRule> corner_rules_;  // by square
};

}  // namespace perch
