#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "perch/detection/runs.h"

namespace perch {

// White is what is brighter than the mean around it: that follows a shadow's edge, which stretches the range
// between the darkest and the brightest pixel of both sides but moves their mean only by the share of each.
// What differs little from its surroundings is black, so of a white area wider than the window a rim remains.
class LocalMean {
 public:
  // Black and white of every row of `grey` (CV_8UC1, not empty). The window reaches `reach` px (at most 15)
  // to every side; white is brighter than its mean by `contrast`.
  void threshold(const cv::Mat& grey, int reach, int contrast, RunImage& image);

 private:
  std::vector<uint16_t> columns_;  // sums over the rows of the window
  std::vector<uint32_t> before_;   // of a row: sums of all columns left of each
  std::vector<uint8_t> levels_;    // of a row
};

// The picture at half the size, each pixel the mean of four; `half` keeps its memory. An odd last row or
// column is left out.
void halve(const cv::Mat& grey, cv::Mat& half);

}  // namespace perch
