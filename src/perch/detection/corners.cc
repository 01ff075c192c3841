#include "perch/detection/corners.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// How far outside the triangle, measured from its nearest side's line; negative inside. The triangle is
// ordered so that each side has the third corner on its positive side.
double outside(const std::array<Eigen::Vector2d, 3>& triangle, const Eigen::Vector2d& p) {
  double farthest = -1;
  for (size_t i = 0; i < 3; ++i) {
    const Eigen::Vector2d side = triangle[(i + 1) % 3] - triangle[i];
    farthest = std::max(farthest, -cross(side, p - triangle[i]) / side.norm());
  }
  return farthest;
}

}  // namespace

std::optional<std::array<Eigen::Vector2d, 4>> quad_corners(std::span<const Eigen::Vector2d> outline,
                                                           const Eigen::Vector2d& centre) {
  if (outline.size() < 4) return std::nullopt;
  const auto before = [&centre](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : (a - centre).squaredNorm() > (b - centre).squaredNorm();
  };
  const auto after = [&centre](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() > b.x() : (a - centre).squaredNorm() > (b - centre).squaredNorm();
  };
  const Eigen::Vector2d left = *std::min_element(outline.begin(), outline.end(), before);
  const Eigen::Vector2d right = *std::min_element(outline.begin(), outline.end(), after);

  const Eigen::Vector2d across = right - left;
  const auto nearer_line = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return std::abs(cross(across, a - left)) < std::abs(cross(across, b - left));
  };
  const Eigen::Vector2d third = *std::max_element(outline.begin(), outline.end(), nearer_line);
  const double turn = cross(across, third - left);
  if (turn == 0) return std::nullopt;

  std::array<Eigen::Vector2d, 3> triangle{left, right, third};
  if (turn < 0) std::swap(triangle[0], triangle[1]);
  const auto less_outside = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return outside(triangle, a) < outside(triangle, b);
  };
  const Eigen::Vector2d fourth = *std::max_element(outline.begin(), outline.end(), less_outside);
  if (outside(triangle, fourth) <= 0) return std::nullopt;

  std::array<Eigen::Vector2d, 4> corners{left, right, third, fourth};
  const Eigen::Vector2d middle = (left + right + third + fourth) / 4;
  std::sort(corners.begin(), corners.end(), [&middle](const auto& a, const auto& b) {
    // y points down: counterclockwise to the eye is the falling angle.
    return std::atan2(a.y() - middle.y(), a.x() - middle.x()) >
           std::atan2(b.y() - middle.y(), b.x() - middle.x());
  });
  return corners;
}

}  // namespace perch
