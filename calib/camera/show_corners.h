#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "calib/camera/board_view.h"

namespace perch {

// The picture in grey with the corners on it, joined in the order in which they are counted: rows in turns of
// six colours, the first corner in a circle.
cv::Mat draw_corners(const cv::Mat& grey, const std::vector<BoardCorner>& corners);

}  // namespace perch
