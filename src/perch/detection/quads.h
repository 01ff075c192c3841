#pragma once

#include <vector>

#include "perch/detection/labelling.h"
#include "perch/detection/segmentation.h"

namespace perch {

// A white region that may be a square of the target.
struct WhiteQuad {
  SeenSquare seen;          // corners in px, moved out to the square's own; of a tiny region its box's
  double side_px = 0;       // root of its area
  bool four_sided = false;  // the corners are measured, and explain the area
  int around = 0;           // label of the black region around it
};

// The white regions that have siblings: at least `siblings` in all in the same black region.
void find_quads(const Segmentation& s, int row_step, int siblings, std::vector<WhiteQuad>& quads);

}  // namespace perch
