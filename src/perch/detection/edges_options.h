#pragma once

#include "perch/config/section.h"

namespace perch {

struct EdgesOptions {
  // Where the threshold of the first proposal lies between the lowest and the highest grey level.
  double threshold_fraction = 0.5;
  // Lines of the raster measured across an edge, at most; more are more accurate and take longer.
  int lines_per_edge = 64;
  // The least step between black and white that counts, grey levels.
  double min_contrast = 12;
  // Part of the lines across the squares' and the border's inner edges that must show the step they should.
  // Three covered squares of six leave 57 %.
  double min_found = 0.52;
  // What no residual of a frame shows, of each piece of an edge: the print. What the whole frame shows (the
  // lens model, the shutter) is learnt from the frames: pose/deformation.h.
  double systematic_px = 0.002;
};

// Reads the section and refuses unknown keys.
EdgesOptions read_edges_options(Section edges);

}  // namespace perch
