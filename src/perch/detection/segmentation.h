#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "perch/detection/components.h"
#include "perch/detection/runs.h"

namespace perch {

// The paper's section 2.1.2: both passes of connected components, and what lies in what. Kept from frame to
// frame for its memory.
struct Segmentation {
  RunImage image;         // the picture's sampled rows
  Components components;  // of the first pass
  RunImage foreground;    // everything but the background
  Components regions;     // of the second pass

  struct Counts {
    int white = 0, black = 0;  // components that are not noise
  };
  std::vector<int> region_of;  // by label of `components`
  std::vector<Counts> counts;  // by label of `regions`
  std::vector<int> holds;      // by label of `components`: how many others, not noise, lie directly in it

  const Component& at(int label) const { return components.list[static_cast<size_t>(label)]; }
  bool is_noise(int label, int min_px) const { return !components.is_root(label) || at(label).area < min_px; }
  int around(int label) const { return surrounding(image, at(label)); }
};

// Components of fewer sampled pixels than `min_px` are noise: they are not counted.
void segment(const cv::Mat& grey, uint8_t level, int row_step, int min_px, Segmentation& s);

// The labels of the components, not noise, that lie directly in the one called `holder`, the outermost of
// its runs first.
void held_by(const Segmentation& s, int holder, int min_px, std::vector<int>& labels);

}  // namespace perch
