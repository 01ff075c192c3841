#pragma once

#include <opencv2/core.hpp>

#include "perch/detection/segmentation.h"

namespace perch {

// Which of the two targets of a nested layout a candidate is. They look the same: what lies in the
// square that may hold the hole tells, what lies around the border, and how large it all is.
//
//   +--------------+
//   | border       |   border of the outer target, black interior
//   |  +--------+  |
//   |  |ring    |  |   ring: what is left of the square that holds the hole
//   |  | hole   |  |   hole: black; in it the border of the inner target
//   |  |  inner |  |
//   |  +--------+  |
//   +--------------+
//
// The outer one holds a hole as soon as it can be seen; the inner one does not, but lies in a ring, unless
// the picture's edge cuts that. To take the inner one for the outer one would put the camera eight times too
// far away, so what is neither for certain is nothing.
enum class NestedPart { kOuter, kInner, kUnknown };

struct NestedCandidate {
  int border = 0;      // label of the white border
  int square = 0;      // label of the square that would hold the hole
  double side_px = 0;  // of that square
};

// `hole_in_square` and `inner_in_hole` are the layout's ratios of sides.
NestedPart nested_part(const Segmentation& s, const NestedCandidate& candidate, double hole_in_square,
                       double inner_in_hole);

}  // namespace perch
