#pragma once

#include <opencv2/aruco.hpp>

#include "calib/camera/board.h"
#include "perch/geometry/rigid3.h"
#include "perch/target/landing_target.h"

namespace perch {

// Boards as a printer has them, for the simulation's renderer: patches on a white sheet. Their corner
// (column, row) is at `point_of`, in the target frame: x right, y up, origin in the middle of the corners.

inline Eigen::Vector2d point_of(const BoardGrid& grid, double column, double row) {
  return grid.spacing * Eigen::Vector2d(column - 0.5 * (grid.columns - 1), 0.5 * (grid.rows - 1) - row);
}

// From the corner (column, row) down right to another.
inline Patch board_patch(const BoardGrid& grid, double column, double row, double to_column, double to_row,
                         bool white) {
  return {{point_of(grid, to_column, row), point_of(grid, column, row), point_of(grid, column, to_row),
           point_of(grid, to_column, to_row)},
          white};
}

// The white sheet, a square's width around the squares, and the dark squares; the upper left one is dark when
// asked.
inline LandingTarget printed_squares(const BoardGrid& grid, bool first_dark) {
  LandingTarget sheet;
  sheet.name = "board";
  sheet.size = grid.spacing * (std::max(grid.columns, grid.rows) + 3);
  sheet.patches.push_back(board_patch(grid, -2, -2, grid.columns + 1, grid.rows + 1, true));
  for (int row = -1; row < grid.rows; ++row) {
    for (int column = -1; column < grid.columns; ++column) {
      if (((row + column) % 2 == 0) == first_dark) {
        sheet.patches.push_back(board_patch(grid, column, row, column + 1, row + 1, false));
      }
    }
  }
  return sheet;
}

// Dark squares are those of an even sum, so the one inside of the first corner is dark and settles how it is
// counted.
inline LandingTarget printed_chessboard(const BoardGrid& grid) { return printed_squares(grid, true); }

// `first_dark`: OpenCV's layout of today; of an even number of rows its older one has the first square white.
inline LandingTarget printed_charuco(const BoardGrid& grid, const CharucoBoard& board, bool first_dark) {
  LandingTarget sheet = printed_squares(grid, first_dark);
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
  const int modules = dictionary->markerSize + 2;
  int id = 0;
  for (int row = -1; row < grid.rows; ++row) {
    for (int column = -1; column < grid.columns; ++column) {
      if (((row + column) % 2 == 0) == first_dark) continue;
      cv::Mat marker;
      dictionary->drawMarker(id++, modules, marker, 1);
      const double low = 0.5 - board.marker_of_square / 2, module = board.marker_of_square / modules;
      for (int y = 0; y < modules; ++y) {
        for (int x = 0; x < modules; ++x) {
          if (marker.at<uint8_t>(y, x) > 0) continue;
          sheet.patches.push_back(board_patch(grid, column + low + x * module, row + low + y * module,
                                              column + low + (x + 1) * module, row + low + (y + 1) * module,
                                              false));
        }
      }
    }
  }
  return sheet;
}

// Kalibr's black squares at the corners of the tags, which the landing target of tags has not.
inline void add_kalibr_squares(LandingTarget& target, double gap) {
  const auto tags = std::get<AprilTagBoard>(target.layout).tags;
  for (const Tag& tag : tags) {
    for (const int right : {0, 1}) {
      for (const int up : {0, 1}) {
        const Eigen::Vector2d corner = tag.centre + tag.size * Eigen::Vector2d(right - 0.5, up - 0.5);
        const Eigen::Vector2d outwards(right ? 0 : -gap, up ? 0 : -gap);
        target.patches.push_back({square_corners(corner + outwards, gap), false});
      }
    }
  }
}

}  // namespace perch
