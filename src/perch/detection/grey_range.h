#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace perch {

// The paper's section 2.1.1: the threshold is a fixed fraction of the way from the lowest to the highest grey
// level that occurs in a sample of the pixels. Of the histogram only its two ends are asked for, so none is
// built: minimum and maximum of every `row_step`-th row are the ends of the histogram of those rows' pixels,
// at a fifth of its cost. The paper samples every seventh pixel; a row is read faster than a column.
struct GreyRange {
  uint8_t lowest = 0;
  uint8_t highest = 0;
};

// `grey` is CV_8UC1 and not empty.
GreyRange sampled_grey_range(const cv::Mat& grey, int row_step);

// Pixels above this level are white.
inline uint8_t threshold_level(const GreyRange& range, double fraction) {
  return static_cast<uint8_t>(range.lowest + fraction * (range.highest - range.lowest));
}

}  // namespace perch
