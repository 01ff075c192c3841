#pragma once

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "calib/camera/board_view.h"
#include "perch/target/edges.h"
#include "perch/target/landing_target.h"

namespace perch {

// A chessboard by its inner corners: 9x6 of them on 10x7 squares.
struct Chessboard {
  int columns = 0, rows = 0;
};

// A ChArUco board by its squares, as OpenCV counts them: 10x7 squares have 9x6 corners.
struct CharucoBoard {
  int columns = 0, rows = 0;
  double marker_of_square = 0.75;  // side of a marker by that of a square
  std::string dictionary;          // OpenCV's name: "4X4_50"
};

// A point's place on the board's grid.
struct GridPlace {
  int column = 0, row = 0;
};

// Tags: point 4 i + k is corner k of tags[i]. Squares: of the edges' shape i, without those of an inner
// target, whose finer grid would have a hundred thousand places, and the outline, whose ground nobody knows.
struct TargetBoard {
  LandingTarget target;
  TargetEdges edges;              // none of tags
  std::vector<GridPlace> places;  // of each point; columns go right and rows down on the printed face
};

// What is photographed. Columns go right and rows down as the camera sees the face.
struct Board {
  std::variant<Chessboard, CharucoBoard, TargetBoard> pattern;
  BoardGrid grid;
  std::string text;  // "chessboard 9x6, 0.025 m"; two boards with the same are the same
};

// From the command line: "9x6" or "charuco:10x7". Throws std::invalid_argument saying what was expected.
// `marker`: side, m; 0 and an empty dictionary for a chessboard.
Board parse_board(const std::string& text, double spacing, double marker = 0,
                  const std::string& dictionary = {});

// A target's YAML, or the YAML of a Kalibr AprilGrid (target_type: 'aprilgrid', tagCols, tagRows, tagSize,
// tagSpacing). Throws ConfigError.
Board read_board(const std::filesystem::path& file);
Board board_of_target(const LandingTarget& target);

// The coarsest grid on which all points lie, with the upper left one's place (0, 0). Throws
// std::invalid_argument where it would have more than 300 places a side.
BoardGrid grid_of_points(const std::vector<Eigen::Vector2d>& points, std::vector<GridPlace>& places);

}  // namespace perch
