#include "calib/camera/frame_choice.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "perch/geometry/homography.h"

namespace perch {

double sharpness(const cv::Mat& grey) {
  if (grey.cols < 4 || grey.rows < 4) return 0;
  cv::Mat small = grey;
  if (grey.cols > 800) cv::resize(grey, small, {}, 0.5, 0.5, cv::INTER_AREA);
  cv::Mat second;
  cv::Laplacian(small, second, CV_16S);
  cv::Scalar mean, deviation;
  cv::meanStdDev(second, mean, deviation);
  return deviation[0] * deviation[0];
}

ViewTraits view_traits(const FoundBoard& found, const BoardGrid& grid) {
  std::vector<Eigen::Vector2d> board, pixel;
  const double scale = 1.0 / std::max(grid.columns - 1, grid.rows - 1);
  const double width = std::max(found.width, 1);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), low(INFINITY, INFINITY), high = -low;
  for (const BoardCorner& c : found.sighting.corners) {
    board.emplace_back((c.column - 0.5 * (grid.columns - 1)) * scale,
                       (c.row - 0.5 * (grid.rows - 1)) * scale);
    pixel.push_back(c.pixel / width);
    sum += pixel.back();
    low = low.cwiseMin(pixel.back());
    high = high.cwiseMax(pixel.back());
  }
  ViewTraits traits = ViewTraits::Zero();
  if (pixel.empty()) return traits;
  const Eigen::Vector2d middle = sum / static_cast<double>(pixel.size());
  traits << middle.x(), middle.y(), 0.5 * (high - low).norm(), 0, 0;
  // The last row of the homography, about the board's middle: by what part the far side is smaller than the
  // near one.
  if (const auto H = homography_from_points(board, pixel); H && std::abs((*H)(2, 2)) > 1e-9) {
    const Eigen::Vector2d tilt = H->row(2).head<2>().transpose() / (*H)(2, 2);
    // In the picture's own directions, so that a board turned in its plane is not another view.
    const Eigen::Vector2d across =
        (H->topLeftCorner<2, 1>() / (*H)(2, 2) - apply(*H, {0, 0}) * tilt.x()).normalized();
    const Eigen::Vector2d sideways(-across.y(), across.x());
    const Eigen::Vector2d in_picture = tilt.x() * across + tilt.y() * sideways;
    traits.tail<2>() = 0.5 * in_picture.cwiseMin(1).cwiseMax(-1);
  }
  return traits;
}

std::vector<size_t> choose_distinct(const std::vector<ViewTraits>& views, size_t most) {
  std::vector<size_t> chosen;
  if (views.empty()) return chosen;
  std::vector<double> distance(views.size(), INFINITY);
  size_t next = 0;
  while (chosen.size() < most && distance[next] > kDistinct) {
    chosen.push_back(next);
    for (size_t i = 0; i < views.size(); ++i)
      distance[i] = std::min(distance[i], (views[i] - views[next]).norm());
    next = static_cast<size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace perch
