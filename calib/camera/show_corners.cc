#include "calib/camera/show_corners.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

namespace perch {

cv::Mat draw_corners(const cv::Mat& grey, const std::vector<BoardCorner>& corners) {
  const std::array<cv::Scalar, 6> colours = {cv::Scalar(60, 60, 255), cv::Scalar(0, 165, 255),
                                             cv::Scalar(0, 230, 230), cv::Scalar(80, 220, 80),
                                             cv::Scalar(255, 160, 0), cv::Scalar(255, 80, 255)};
  constexpr int kShift = 4;
  const auto at = [](const BoardCorner& c) {
    return cv::Point(cvRound(c.pixel.x() * (1 << kShift)), cvRound(c.pixel.y() * (1 << kShift)));
  };
  cv::Mat picture;
  cv::cvtColor(grey, picture, cv::COLOR_GRAY2BGR);
  const int radius = std::max(3, grey.cols / 200);
  for (size_t i = 0; i < corners.size(); ++i) {
    const cv::Scalar& colour = colours[static_cast<size_t>(std::max(corners[i].row, 0)) % colours.size()];
    if (i > 0) cv::line(picture, at(corners[i - 1]), at(corners[i]), colour, 1, cv::LINE_AA, kShift);
    cv::circle(picture, at(corners[i]), radius << kShift, colour, 1, cv::LINE_AA, kShift);
    if (i == 0) cv::circle(picture, at(corners[i]), (3 * radius) << kShift, colour, 2, cv::LINE_AA, kShift);
  }
  return picture;
}

}  // namespace perch
