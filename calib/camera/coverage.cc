#include "calib/camera/coverage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

double turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Andrew's monotone chain, counterclockwise.
Polygon convex_hull(const BoardView& view) {
  Polygon points;
  for (const auto& corner : view.corners) points.push_back(corner.pixel);
  std::ranges::sort(
      points, [](const auto& a, const auto& b) { return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y()); });
  Polygon hull;
  for (int pass = 0; pass < 2; ++pass) {
    const size_t start = hull.size();
    for (const auto& p : points) {
      while (hull.size() >= start + 2 && turn(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    std::ranges::reverse(points);
  }
  return hull;
}

bool is_inside(const Polygon& hull, const Eigen::Vector2d& p) {
  for (size_t i = 0; i < hull.size(); ++i) {
    if (turn(hull[i], hull[(i + 1) % hull.size()], p) < 0) return false;
  }
  return hull.size() >= 3;
}

// Thirds of the picture, as one speaks of them.
constexpr std::array<const char*, 9> kPlaces{"upper left corner", "upper edge", "upper right corner",
                                             "left edge",         "middle",     "right edge",
                                             "lower left corner", "lower edge", "lower right corner"};

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

std::string number(double value, const char* format) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// Where no corner has been. Of edges and corners the outermost eighth of the picture counts: it is there that
// lenses bend most.
std::vector<std::string> empty_places(const BoardViews& views) {
  constexpr int kCells = 8;
  const auto cells = corners_by_cell(views, kCells, kCells);
  constexpr int kParts[3][2] = {{0, 0}, {1, 6}, {7, 7}};  // cells, first and last
  std::vector<std::string> empty;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      int corners = 0;
      for (int y = kParts[row][0]; y <= kParts[row][1]; ++y) {
        for (int x = kParts[column][0]; x <= kParts[column][1]; ++x)
          corners += cells[static_cast<size_t>(y * kCells + x)];
      }
      if (corners == 0)
        empty.push_back(std::string(row == 1 || column == 1 ? "at the " : "in the ") +
                        kPlaces[static_cast<size_t>(3 * row + column)]);
    }
  }
  return empty;
}

}  // namespace

std::vector<bool> covered_places(const BoardViews& views, int columns, int rows) {
  std::vector<bool> covered(static_cast<size_t>(columns * rows), false);
  for (const auto& view : views.views) {
    const Polygon hull = convex_hull(view);
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const Eigen::Vector2d p((views.width - 1.0) * column / (columns - 1),
                                (views.height - 1.0) * row / (rows - 1));
        const auto at = static_cast<size_t>(row * columns + column);
        if (!covered[at]) covered[at] = is_inside(hull, p);
      }
    }
  }
  return covered;
}

std::vector<int> corners_by_cell(const BoardViews& views, int columns, int rows) {
  std::vector<int> cells(static_cast<size_t>(columns * rows), 0);
  for (const auto& view : views.views) {
    for (const auto& corner : view.corners) {
      const int x = static_cast<int>(std::floor((corner.pixel.x() + 0.5) / views.width * columns));
      const int y = static_cast<int>(std::floor((corner.pixel.y() + 0.5) / views.height * rows));
      if (x >= 0 && x < columns && y >= 0 && y < rows) ++cells[static_cast<size_t>(y * columns + x)];
    }
  }
  return cells;
}

std::vector<BoardPose> board_poses(const BoardViews& views, const LensFit& fit) {
  const Eigen::Vector3d middle(0.5 * (views.grid.columns - 1) * views.grid.spacing,
                               0.5 * (views.grid.rows - 1) * views.grid.spacing, 0);
  std::vector<BoardPose> poses;
  for (const auto& v : fit.camera_from_board) {
    const Eigen::Quaterniond rotation = so3_exp(v.head<3>());
    const Eigen::Vector3d centre = rotation * middle + v.tail<3>();
    Eigen::Vector3d normal = rotation * Eigen::Vector3d::UnitZ();
    if (normal.dot(centre) < 0) normal = -normal;  // away from the camera
    // How it leans against the line of sight: the normal in axes that look along it.
    const Eigen::Vector3d seen =
        Eigen::Quaterniond::FromTwoVectors(centre, Eigen::Vector3d::UnitZ()) * normal;
    poses.push_back(
        {std::atan2(seen.head<2>().norm(), seen.z()), std::atan2(seen.y(), seen.x()), centre.norm()});
  }
  return poses;
}

std::vector<std::string> what_is_missing(const BoardViews& views, const LensFit& fit) {
  constexpr double kTilted = 15 * kRadFromDeg;   // less shows hardly any perspective
  constexpr double kParallel = 5 * kRadFromDeg;  // normals closer together than this are one
  constexpr size_t kEnough = 20;                 // pictures: the uncertainty falls little from there on
  std::vector<std::string> missing;
  const auto poses = board_poses(views, fit);

  double widest = 0;
  for (const auto& a : fit.camera_from_board) {
    const Eigen::Vector3d n = so3_exp(a.head<3>()) * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d first = so3_exp(fit.camera_from_board.front().head<3>()) * Eigen::Vector3d::UnitZ();
    widest = std::max(widest, std::atan2(n.cross(first).norm(), std::abs(n.dot(first))));
  }
  double tilt = 0;
  int quarters[4] = {0, 0, 0, 0}, tilted = 0;
  for (const auto& pose : poses) {
    tilt = std::max(tilt, pose.tilt);
    if (pose.tilt < kTilted) continue;
    ++tilted;
    ++quarters[static_cast<int>(std::floor((pose.direction + M_PI / 4) / (M_PI / 2)) + 4) % 4];
  }
  if (widest < kParallel) {
    missing.push_back(
        "All boards are parallel to within " + number(widest * kDegFromRad, "%.1f") +
        " degrees: the focal length cannot be told from the distance. Tilt the board by 20 to 45 degrees, "
        "towards all four sides.");
  } else if (tilted < 4) {
    missing.push_back(
        "Only " + std::to_string(tilted) +
        " boards are tilted by more than 15 degrees (the most: " + number(tilt * kDegFromRad, "%.0f") +
        "): focal length and distance are hard to tell apart. Tilt the board by 20 to 45 degrees.");
  } else {
    constexpr const char* kSides[4] = {"right", "bottom", "left", "top"};
    std::vector<std::string> sides;
    for (size_t i = 0; i < 4; ++i) {
      if (quarters[i] == 0) sides.emplace_back(kSides[i]);
    }
    if (!sides.empty()) {
      missing.push_back("No board is tilted with its far side to the " + listed(sides) +
                        " of the picture: tilt it there by 20 to 45 degrees.");
    }
  }
  if (const auto empty = empty_places(views); !empty.empty())
    missing.push_back("No corner " + listed(empty) + " of the picture: hold the board there, tilted.");
  const auto [near, far] = std::ranges::minmax(poses, {}, &BoardPose::distance);
  if (far.distance < 1.3 * near.distance) {
    missing.push_back("All boards are " + number(near.distance, "%.2f") + " to " +
                      number(far.distance, "%.2f") + " m away: take some from half and from twice as far.");
  }
  if (views.views.size() < kEnough) {
    missing.push_back("There are " + std::to_string(views.views.size()) +
                      " pictures: " + std::to_string(kEnough) +
                      " or more, each with the board elsewhere, make every number here smaller.");
  }
  return missing;
}

}  // namespace perch
