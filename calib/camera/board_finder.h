#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/board.h"
#include "perch/camera/camera_model.h"

namespace perch {

// A board in one picture.
struct BoardSighting {
  std::vector<BoardCorner> corners;  // by rows; empty: none was found
  double blur_px = 0;                // deviation of the worse direction's edges, as edge_width.h has it
  std::string problem;               // why there is none: "no 9x6 chessboard"
};

// Finds a board. Keeps its buffers: one finder serves one thread. The same picture gives the same corners.
class BoardFinder {
 public:
  virtual ~BoardFinder() = default;
  // `grey` is CV_8UC1 of any size.
  virtual BoardSighting find(const cv::Mat& grey) = 0;
};

// `lens`: what is known of it so far. Only a landing target of squares needs one, as its labels hold by a
// homography; without one several rough lenses are tried. Throws std::invalid_argument for a dictionary
// OpenCV has not.
std::unique_ptr<BoardFinder> make_board_finder(const Board& board,
                                               const std::optional<CameraModel>& lens = {});

// The kinds, each in its own file.
std::unique_ptr<BoardFinder> make_chessboard_finder(const Chessboard& board);
std::unique_ptr<BoardFinder> make_charuco_finder(const CharucoBoard& board);
std::unique_ptr<BoardFinder> make_tags_finder(const TargetBoard& board);
std::unique_ptr<BoardFinder> make_squares_finder(const TargetBoard& board,
                                                 const std::optional<CameraModel>& lens);

// The size of a chessboard that the picture shows, whatever its size; {0, 0} without one.
cv::Size chessboard_in(const cv::Mat& grey);

}  // namespace perch
