#include "perch/detection/edges_options.h"

namespace perch {

EdgesOptions read_edges_options(Section edges) {
  EdgesOptions o;
  edges.read("threshold_fraction", o.threshold_fraction, kFraction);
  edges.read("lines_per_edge", o.lines_per_edge, Range{1, 100000});
  edges.read("min_contrast", o.min_contrast, Range{1, 255});
  edges.read("min_found", o.min_found, kFraction);
  edges.read("systematic_px", o.systematic_px, Range{0, 10});
  edges.done();
  return o;
}

}  // namespace perch
