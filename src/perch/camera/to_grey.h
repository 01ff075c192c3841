#pragma once

#include <opencv2/core.hpp>

#include "perch/camera/image_source.h"

namespace perch {

// A decoded picture (8 or 16 bits, BGR order, with alpha or not) as Frame::grey. Grey is BT.601's, as OpenCV
// has it: 0.299 R + 0.587 G + 0.114 B. May share its memory with `picture`.
cv::Mat to_grey(const cv::Mat& picture, Channel channel);

}  // namespace perch
