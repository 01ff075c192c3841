#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "support/rng.h"

namespace perch {

// Every pixel anew between two levels.
inline cv::Mat random_picture(TestRng& rng, int width, int height, int low = 0, int high = 255) {
  cv::Mat grey(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      grey.at<uint8_t>(y, x) = static_cast<uint8_t>(low + rng.index(high - low + 1));
  }
  return grey;
}

// Black and white; `density` of it white.
inline cv::Mat random_binary(TestRng& rng, int width, int height, double density) {
  cv::Mat grey(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) grey.at<uint8_t>(y, x) = rng.uniform(0, 1) < density ? 255 : 0;
  }
  return grey;
}

}  // namespace perch
