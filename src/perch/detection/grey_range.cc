#include "perch/detection/grey_range.h"

#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>

namespace perch {

GreyRange sampled_grey_range(const cv::Mat& grey, int row_step) {
  GreyRange range{255, 0};
  cv::v_uint8x16 low = cv::v_setall_u8(255);
  cv::v_uint8x16 high = cv::v_setall_u8(0);
  for (int y = 0; y < grey.rows; y += row_step) {
    const uint8_t* row = grey.ptr<uint8_t>(y);
    int x = 0;
    for (; x + 16 <= grey.cols; x += 16) {
      const cv::v_uint8x16 v = cv::v_load(row + x);
      low = cv::v_min(low, v);
      high = cv::v_max(high, v);
    }
    for (; x < grey.cols; ++x) {
      range.lowest = std::min(range.lowest, row[x]);
      range.highest = std::max(range.highest, row[x]);
    }
  }
  uint8_t lane[16];
  cv::v_store(lane, low);
  range.lowest = std::min(range.lowest, *std::min_element(lane, lane + 16));
  cv::v_store(lane, high);
  range.highest = std::max(range.highest, *std::max_element(lane, lane + 16));
  return range;
}

}  // namespace perch
