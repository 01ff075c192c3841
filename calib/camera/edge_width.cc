#include "calib/camera/edge_width.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace perch {
namespace {

constexpr double kStep = 0.5;          // px between samples across an edge
constexpr double kReach = 8;           // px to either side, at most
constexpr double kLeastContrast = 20;  // grey levels; less is no edge

double grey_at(const cv::Mat& grey, const Eigen::Vector2d& p) {
  const int x = static_cast<int>(p.x()), y = static_cast<int>(p.y());
  const double u = p.x() - x, v = p.y() - y;
  const uint8_t* a = grey.ptr<uint8_t>(y) + x;
  const uint8_t* b = grey.ptr<uint8_t>(y + 1) + x;
  return (1 - v) * ((1 - u) * a[0] + u * a[1]) + v * ((1 - u) * b[0] + u * b[1]);
}

bool inside(const cv::Mat& grey, const Eigen::Vector2d& p) {
  return p.x() >= 0 && p.y() >= 0 && p.x() < grey.cols - 1 && p.y() < grey.rows - 1;
}

// The deviation of the step between two corners, across the middle of their line; 0: no step. A blurred
// step's greatest slope is its height / (sqrt(2 pi) deviation).
double width_between(const cv::Mat& grey, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = b - a;
  const double length = along.norm();
  if (length < 6) return 0;
  const Eigen::Vector2d normal = Eigen::Vector2d(-along.y(), along.x()) / length;
  const int reach = static_cast<int>(std::min(kReach, 0.35 * length) / kStep);
  std::vector<double> profile(static_cast<size_t>(2 * reach + 1), 0.0);
  for (int k = -reach; k <= reach; ++k) {
    for (const double part : {0.4, 0.45, 0.5, 0.55, 0.6}) {
      const Eigen::Vector2d p = a + part * along + k * kStep * normal;
      if (!inside(grey, p)) return 0;
      profile[static_cast<size_t>(k + reach)] += grey_at(grey, p) / 5;
    }
  }
  const double height = std::abs(profile.back() - profile.front());
  double slope = 0;
  for (size_t i = 2; i < profile.size(); ++i) slope = std::max(slope, std::abs(profile[i] - profile[i - 2]));
  if (height < kLeastContrast) return 0;
  return height * 2 * kStep / (slope * std::sqrt(2 * M_PI));
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

double edge_width(const cv::Mat& grey, const std::vector<BoardCorner>& corners) {
  std::map<std::pair<int, int>, Eigen::Vector2d> by_row, by_column;
  for (const BoardCorner& c : corners) {
    by_row[{c.row, c.column}] = c.pixel;
    by_column[{c.column, c.row}] = c.pixel;
  }
  double widest = 0;
  for (const auto* lines : {&by_row, &by_column}) {
    std::vector<double> widths;
    for (auto a = lines->begin(), b = std::next(a, a != lines->end()); b != lines->end(); ++a, ++b) {
      if (a->first.first != b->first.first) continue;
      if (const double width = width_between(grey, a->second, b->second); width > 0) widths.push_back(width);
    }
    widest = std::max(widest, median(widths));
  }
  return widest;
}

}  // namespace perch
