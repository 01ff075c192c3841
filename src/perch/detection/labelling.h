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
  // Empty when the layout has no such anchor.
  static std::optional<Labelling> of(const SquaresLayout& layout);

  // The seen squares in the layout's order, each with its corners in the order of its features. Empty when
  // their number is wrong or no square, or more than one, can be the anchor.
  std::optional<std::vector<SeenSquare>> label(std::span<const SeenSquare> seen) const;

 private:
  struct CornerRule {
    int towards = 0;  // the square whose direction is the reference
    int first = 0;    // the feature (0..3) that comes first counterclockwise from it
  };
  int anchor_ = 0;
  std::vector<int> order_;                // the other squares as they come around the anchor
  std::vector<CornerRule> corner_rules_;  // by square
};

}  // namespace perch
