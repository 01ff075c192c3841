#pragma once

#include <opencv2/core.hpp>

#include "perch/camera/image_source.h"

namespace perch {

// A decoded picture (8 or 16 bits, BGR order, with alpha or not) as Frame::grey. Grey is BT.601's, as OpenCV
// has it: 0.299 R + 0.587 G + 0.114 B. May share its memory with `picture`.
cv::Mat to_grey(const cv::Mat& picture, Channel channel);

// Where a channel is in BGR order.
inline int bgr_index(Channel channel) {
  return channel == Channel::kBlue ? 0 : channel == Channel::kGreen ? 1 : 2;
}

}  // namespace perch
