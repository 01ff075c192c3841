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
  int first_run = -1;                            // the leftmost of its top row; -1: the frame has none
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

// The component around this one: that of the pixel left of its topmost, leftmost pixel. Nothing of the
// component is above that pixel or left of it, so its neighbour is outside of it and not in a hole.
inline int surrounding(const RunImage& image, const Component& component) {
  const Run& first = image.runs[static_cast<size_t>(component.first_run)];
  return first.begin == 0 ? Components::kFrame
                          : image.runs[static_cast<size_t>(component.first_run) - 1].label;
}

// The paper's second pass: "a new binary image where we define the background as black and all other regions
// as white". `image` must be labelled.
void foreground_runs(const RunImage& image, RunImage& foreground);

}  // namespace perch
