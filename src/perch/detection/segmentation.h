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
  int min_px = 1;          // components of fewer sampled pixels are noise: they are not counted
  RunImage image;          // the picture's sampled rows
  Components components;   // of the first pass
  std::vector<int> holds;  // by label of `components`: how many others, not noise, lie directly in it

  struct Counts {
    int white = 0, black = 0;
  };
  // Of the second pass, which is made when its counts are first asked for: most pictures hold nothing that
  // asks.
  bool second_pass = false;
  RunImage foreground;  // everything but the background
  Components regions;
  std::vector<Counts> counts;  // by label of `regions`

  const Component& at(int label) const { return components.list[static_cast<size_t>(label)]; }
  bool is_noise(int label) const { return !components.is_root(label) || at(label).area < min_px; }
  int around(int label) const { return surrounding(image, at(label)); }
};

// The first pass of `image`, which is there already.
void segment_runs(int min_px, Segmentation& s);

// The same of a picture's rows above a level.
void segment(const cv::Mat& grey, uint8_t level, int row_step, int min_px, Segmentation& s);

// How many components there are in the foreground region that this component is part of.
Segmentation::Counts counts_in_region_of(int label, Segmentation& s);

// The labels of the components, not noise, that lie directly in the one called `holder`.
void held_by(const Segmentation& s, int holder, std::vector<int>& labels);

}  // namespace perch
