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

// Adds the next row's end to one side of a convex outline (`side` 1: the right one, -1: the left one): the
// ends before it that are not outside the line to it go.
void extend(std::vector<Eigen::Vector2d>& chain, const Eigen::Vector2d& p, double side) {
  while (chain.size() >= 2) {
    const Eigen::Vector2d& a = chain[chain.size() - 2];
    const Eigen::Vector2d ab = chain.back() - a, ap = p - a;
    if (side * (ab.x() * ap.y() - ap.x() * ab.y()) > 0) break;
    chain.pop_back();
  }
  chain.push_back(p);
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
  // It is the component with the square's first pixel; its box may hold parts of its neighbours too.
  const int column = sampled.runs[static_cast<size_t>(square.first_run)].begin;
  const int label = label_at(window_, column - box.x, square.top * row_step - box.y);
  const Component& whole = components_.list[static_cast<size_t>(label)];

  // Only corners of the convex hull can be farthest in any direction: some sixteen of hundreds of row ends.
  left_.clear();
  right_.clear();
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
    extend(left_, Eigen::Vector2d(begin, y), -1);
    extend(right_, Eigen::Vector2d(end - 1, y), 1);
  }
  left_.insert(left_.end(), right_.begin(), right_.end());
  const Eigen::Vector2d centre = sum / pixels;
  const auto corners = quad_corners(left_, centre);
  if (!corners || !explained(*corners, pixels)) return std::nullopt;
  const Eigen::Vector2d origin(box.x, box.y);
  SeenSquare seen{centre + origin, *corners};
  for (auto& corner : seen.corners) corner += origin;
  return seen;
}

}  // namespace perch
