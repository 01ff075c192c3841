// What a calibration reads off pictures: corners of a flat board, on a regular grid of which some may be
// missing.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace perch {

// The board as mrcal sees it: a grid of corners in the plane z = 0, the corner (column, row) at (column, row)
// * spacing. A landing target or an AprilGrid lies on such a grid too, with most places empty.
struct BoardGrid {
  int columns = 0;
  int rows = 0;
  double spacing = 0;  // m
};

// A corner found: its place on the grid, its pixel (the centre of the top-left pixel is (0, 0)) and how well
// it is known.
struct BoardCorner {
  int column = 0;
  int row = 0;
  Eigen::Vector2d pixel;
  double sigma = 1;  // px, relative between corners; weights are 1 / sigma
};

// One picture of the board.
struct BoardView {
  std::string picture;  // the file's path, or "video.mkv#412"
  std::vector<BoardCorner> corners;
};

// All of one camera at one zoom.
struct BoardViews {
  BoardGrid grid;
  int width = 0;  // of every picture, px
  int height = 0;
  std::vector<BoardView> views;
};

}  // namespace perch
