#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "perch/detection/edge_piece.h"
#include "perch/detection/plane_fit.h"

namespace perch {

// What was looked for and found on the lines across one edge.
struct EdgeTally {
  int asked = 0;  // lines that cross it in the picture
  int found = 0;  // of these, with a step of the right polarity where it should be
};

struct SearchOptions {
  double radius = 4;     // how far from where they are expected edges are looked for, px
  int lines = 2;         // across an edge
  double contrast = 10;  // least difference between the two sides, grey levels
};

// A step of grey found on one line.
struct FoundStep {
  int edge = 0;
  double contrast = 0;  // grey levels
  double width = 1;     // deviation of the blur along the normal as the step's slope tells, px
};

// Looks for each edge's step along lines of the raster: the steepest place of the right polarity within the
// radius and 0.4 of the gap to the next edge, to about a tenth of a pixel. Replaces all three: `offsets` and
// `steps` have one entry for each line that was found, `tallies` one for each edge of the target.
void search_edges(const cv::Mat& grey, std::span<const EdgePiece> pieces, const ImageFrame& frame,
                  const SearchOptions& options, std::vector<EdgeOffset>& offsets,
                  std::vector<FoundStep>& steps, std::vector<EdgeTally>& tallies);

}  // namespace perch
