#include "perch/detection/square_corners.h"

#include <algorithm>
#include <cmath>

#include "perch/detection/corners.h"

namespace perch {
namespace {

// A right answer of four corners explains how many pixels the square has: with the polygon through the
// corners' pixel centres, Pick's theorem says area + b / 2 + 1, where b, the lattice points on its sides, is
// at most the perimeter. A round blob, a triangle, two squares grown together do not add up: a circle has
// 57 % more. Beyond the paper, which checks nothing.
bool explained(const std::array<Eigen::Vector2d, 4>& corners, double pixels) {
  double twice_area = 0, perimeter = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d& b = corners[(i + 1) % 4];
    twice_area += b.x() * a.y() - a.x() * b.y();  // counterclockwise where y points down
    perimeter += (b - a).norm();
  }
  // A quarter of the perimeter is the middle of what b / 2 can be; twice that, and a fifth of the square, is
  // left to blur and noise.
  return std::abs(pixels - (twice_area / 2 + perimeter / 4 + 1)) <= perimeter / 2 + 0.2 * pixels;
}

}  // namespace

std::optional<SeenSquare> SquareCorners::measure(const cv::Mat& grey, uint8_t level, int row_step,
                                                 const RunImage& sampled, const Component& square) {
  // The rows that were skipped may belong to the square; and a pixel of margin, so that it ends inside the
  // window.
  const cv::Rect wanted(square.left - row_step, (square.top - 1) * row_step,
                        square.right - square.left + 1 + 2 * row_step,
                        (square.bottom - square.top + 2) * row_step + 1);
  const cv::Rect box = wanted & cv::Rect(0, 0, grey.cols, grey.rows);
  threshold_to_runs(grey(box), level, 1, window_);
  label_components(window_, components_);
  // It is the component with the square's first pixel. (Not the largest: a slanting square's box may hold
  // more of its neighbours than of itself.)
  const int column = sampled.runs[static_cast<size_t>(square.first_run)].begin;
  const int label = label_at(window_, column - box.x, square.top * row_step - box.y);
  const Component& whole = components_.list[static_cast<size_t>(label)];

  outline_.clear();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double pixels = 0;
  for (int y = whole.top; y <= whole.bottom; ++y) {
    const auto& row = window_.rows[static_cast<size_t>(y)];
    // From its first to its last run: what is between them, a nested target's hole or noise, is inside.
    int begin = grey.cols, end = 0;
    for (int i = row.first; i < row.first + row.count; ++i) {
      const Run& run = window_.runs[static_cast<size_t>(i)];
      if (run.label != label) continue;
      begin = std::min(begin, run.begin);
      end = run.end;
    }
    const double length = end - begin;
    pixels += length;
    sum += length * Eigen::Vector2d(0.5 * (begin + end - 1), y);
    outline_.emplace_back(begin, y);
    outline_.emplace_back(end - 1, y);
  }
  const Eigen::Vector2d centre = sum / pixels;
  const auto corners = quad_corners(outline_, centre);
  if (!corners || !explained(*corners, pixels)) return std::nullopt;
  const Eigen::Vector2d origin(box.x, box.y);
  SeenSquare seen{centre + origin, *corners};
  for (auto& corner : seen.corners) corner += origin;
  return seen;
}

}  // namespace perch
