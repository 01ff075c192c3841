#pragma once

#include <vector>

#include "perch/detection/runs.h"

namespace perch {

// The paper's section 2.1.2: regions of equal colour by 4-connectivity, here of runs (Rosenfeld's two-pass
// labelling with a union-find), black and white in one pass.
struct Component {
  int parent = 0;                                // itself when it is a root
  int area = 0;                                  // pixels of the sampled rows
  int left = 0, top = 0, right = 0, bottom = 0;  // bounding box, inclusive; rows as in RunImage::rows
  bool white = false;
};

// Component 0 is the one-pixel black frame that the paper puts around the picture: it joins all black regions
// that touch the edge, and so is the background.
struct Components {
  std::vector<Component> list;

  static constexpr int kFrame = 0;
  bool is_root(int label) const { return list[static_cast<size_t>(label)].parent == label; }
};

// Labels every run with its root component. Only roots of `components` are meaningful afterwards.
void label_components(RunImage& image, Components& components);

// The paper's second pass: "a new binary image where we define the background as black and all other regions
// as white". `image` must be labelled.
void foreground_runs(const RunImage& image, RunImage& foreground);

}  // namespace perch
