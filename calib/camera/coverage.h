#pragma once

#include <string>
#include <vector>

#include "calib/camera/board_view.h"
#include "calib/camera/lens_fit.h"

namespace perch {

// Which places of a map of the picture (lens_covariance.h) lie within the hull of the corners of some view.
std::vector<bool> covered_places(const BoardViews& views, int columns, int rows);

// How many corners lie in each of columns x rows equal cells of the picture, row by row.
std::vector<int> corners_by_cell(const BoardViews& views, int columns, int rows);

// How the boards stood, from a fit.
struct BoardPose {
  double tilt = 0;       // between the board's normal and the line of sight, rad
  double direction = 0;  // in which the board leans, in the picture: rad from right towards down
  double distance = 0;   // of the board's middle, m
};
std::vector<BoardPose> board_poses(const BoardViews& views, const LensFit& fit);

// What the pictures lack, one sentence each with what to do about it. Empty: nothing.
std::vector<std::string> what_is_missing(const BoardViews& views, const LensFit& fit);

}  // namespace perch
