#pragma once

#include <array>
#include <opencv2/core/hal/intrin.hpp>

namespace perch {

// Of four floats, in the same order on every processor, so that they round alike: OpenCV's own sum differs.
inline float sum_in_order(const cv::v_float32x4& four) {
  alignas(16) std::array<float, 4> each;
  cv::v_store_aligned(each.data(), four);
  return (each[0] + each[1]) + (each[2] + each[3]);
}

}  // namespace perch
