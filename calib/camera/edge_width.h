#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calib/camera/board_view.h"

namespace perch {

// How blurred the board's edges are: their deviation in px, of the worse of the board's two directions, since
// motion blurs those across it alone. A sharp picture has 0.6 to 0.8, the interpolation's own 0.4 included. 0
// where no two neighbouring corners have an edge between them.
double edge_width(const cv::Mat& grey, const std::vector<BoardCorner>& corners);

}  // namespace perch
