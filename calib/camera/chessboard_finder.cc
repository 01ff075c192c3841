#include <algorithm>
#include <array>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calib/camera/board_finder.h"
#include "calib/camera/edge_width.h"

namespace perch {
namespace {

// Corners by rows, as OpenCV gives them.
struct Corners {
  int columns = 0, rows = 0;
  std::vector<Eigen::Vector2d> at;
  const Eigen::Vector2d& operator()(int column, int row) const {
    return at[static_cast<size_t>(row * columns + column)];
  }
};

Corners turned(const Corners& from, int quarters) {
  Corners to = from;
  for (int k = 0; k < quarters; ++k) {
    Corners next{to.rows, to.columns, {}};
    for (int row = 0; row < next.rows; ++row) {
      for (int column = 0; column < next.columns; ++column) next.at.push_back(to(row, to.rows - 1 - column));
    }
    to = next;
  }
  return to;
}

Corners mirrored(const Corners& from) {
  Corners to{from.columns, from.rows, {}};
  for (int row = from.rows - 1; row >= 0; --row) {
    for (int column = 0; column < from.columns; ++column) to.at.push_back(from(column, row));
  }
  return to;
}

// Mean grey of the squares of (column + row) even less that of the others: below 0 where the first is dark.
double first_square(const cv::Mat& grey, const Corners& corners) {
  double even = 0, odd = 0;
  int evens = 0, odds = 0;
  for (int row = 0; row + 1 < corners.rows; ++row) {
    for (int column = 0; column + 1 < corners.columns; ++column) {
      const Eigen::Vector2d p = 0.25 * (corners(column, row) + corners(column + 1, row) +
                                        corners(column, row + 1) + corners(column + 1, row + 1));
      const int x = std::clamp(static_cast<int>(p.x() + 0.5), 0, grey.cols - 1);
      const int y = std::clamp(static_cast<int>(p.y() + 0.5), 0, grey.rows - 1);
      ((column + row) % 2 ? odd : even) += grey.at<uint8_t>(y, x);
      ++((column + row) % 2 ? odds : evens);
    }
  }
  return even / std::max(evens, 1) - odd / std::max(odds, 1);
}

// Of all ways in which the corners can be counted, columns right and rows down: first dark squares, where the
// board's colours decide, and then the one that stands most upright. A board of which half a turn (or, as
// many columns as rows, a quarter) shows no difference is thus counted as whoever holds the camera upright
// would.
Corners settled(const cv::Mat& grey, Corners corners, int columns, int rows) {
  const Eigen::Vector2d right = corners(1, 0) - corners(0, 0), down = corners(0, 1) - corners(0, 0);
  if (right.x() * down.y() - right.y() * down.x() < 0) corners = mirrored(corners);
  Corners best;
  double best_score = -INFINITY;
  for (int quarters = 0; quarters < 4; ++quarters) {
    const Corners way = turned(corners, quarters);
    if (way.columns != columns || way.rows != rows) continue;
    const Eigen::Vector2d across =
        way(columns - 1, 0) - way(0, 0) + way(columns - 1, rows - 1) - way(0, rows - 1);
    const double score = (first_square(grey, way) < 0 ? 10 : 0) + across.normalized().x();
    if (score > best_score) best = way;
    best_score = std::max(score, best_score);
  }
  return best;
}

// OpenCV's own sub-pixel places are of its fit to the whole board: through a lens of 120 degrees 0.12 px off,
// with noise of 2 grey levels and no lens 0.035 px. Where four squares meet is known to 0.025 px and 0.022 px
// by the gradients there.
void refine(const cv::Mat& grey, Corners& corners) {
  double side = INFINITY;
  for (int row = 0; row + 1 < corners.rows; ++row) {
    for (int column = 0; column + 1 < corners.columns; ++column) {
      side = std::min(side, (corners(column + 1, row) - corners(column, row)).norm());
      side = std::min(side, (corners(column, row + 1) - corners(column, row)).norm());
    }
  }
  const int reach = std::clamp(static_cast<int>(0.3 * side), 2, 5);
  std::vector<cv::Point2f> points;
  for (const auto& p : corners.at) points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  cv::cornerSubPix(grey, points, {reach, reach}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d found(points[i].x, points[i].y);
    if ((found - corners.at[i]).norm() < 1.5) corners.at[i] = found;  // else something lies beside it
  }
}

// A board that fills a tenth of a picture of this width has squares of a dozen pixels, which is enough to
// find it; a picture twice as wide takes four times as long.
constexpr int kWideEnough = 640;  // px

class ChessboardFinder : public BoardFinder {
 public:
  explicit ChessboardFinder(const Chessboard& board) : board_(board) {}

  BoardSighting find(const cv::Mat& grey) override {
    halve(grey);
    BoardSighting sighting;
    const cv::Size size(board_.columns, board_.rows);
    cv::Mat found;
    const auto level = look(size, found);
    if (!level) {
      sighting.problem =
          "no " + std::to_string(size.width) + "x" + std::to_string(size.height) + " chessboard";
      return sighting;
    }
    Corners corners{size.width, size.height, {}};
    for (int i = 0; i < size.area(); ++i) {
      const auto& p = found.at<cv::Point2f>(i);
      corners.at.emplace_back(p.x, p.y);
    }
    // From each size to the next, so that none begins farther off than it can see.
    for (size_t i = *level;; --i) {
      refine(sizes_[i], corners);
      if (i == 0) break;
      for (auto& p : corners.at) p = 2 * p + Eigen::Vector2d(0.5, 0.5);
    }
    corners = settled(grey, corners, size.width, size.height);
    for (int row = 0; row < size.height; ++row) {
      for (int column = 0; column < size.width; ++column) {
        sighting.corners.push_back({column, row, corners(column, row), 1});
      }
    }
    sighting.blur_px = edge_width(grey, sighting.corners);
    return sighting;
  }

 private:
  // The picture, and halved until it is small enough to look for a board quickly.
  void halve(const cv::Mat& grey) {
    sizes_.resize(1);
    sizes_[0] = grey;
    while (std::max(sizes_.back().cols, sizes_.back().rows) >= 2 * kWideEnough) {
      cv::Mat half;
      // Even sizes alone: a pixel is then exactly the mean of four.
      const cv::Mat even =
          sizes_.back()(cv::Rect(0, 0, sizes_.back().cols / 2 * 2, sizes_.back().rows / 2 * 2));
      cv::resize(even, half, {}, 0.5, 0.5, cv::INTER_AREA);
      sizes_.push_back(half);
    }
  }

  // The size at which the board shows, if any. CALIB_CB_EXHAUSTIVE and CALIB_CB_ACCURACY (which doubles the
  // picture first) find more and take ten times as long: only where the first look shows nothing. Of large
  // pictures the last look is for boards whose squares are too small in the smallest.
  std::optional<size_t> look(const cv::Size& size, cv::Mat& found) const {
    const size_t smallest = sizes_.size() - 1;
    const auto shows = [&](size_t level, int flags) {
      return cv::findChessboardCornersSB(sizes_[level], size, found, flags);
    };
    // Neither flag's finds hold all of the other's.
    for (const int flags : {0, int{cv::CALIB_CB_ACCURACY}, cv::CALIB_CB_ACCURACY | cv::CALIB_CB_EXHAUSTIVE}) {
      if (shows(smallest, flags)) return smallest;
    }
    if (smallest > 0 && shows(0, cv::CALIB_CB_EXHAUSTIVE)) return 0;
    return std::nullopt;
  }

  Chessboard board_;
  std::vector<cv::Mat> sizes_;
};

}  // namespace

std::unique_ptr<BoardFinder> make_chessboard_finder(const Chessboard& board) {
  return std::make_unique<ChessboardFinder>(board);
}

cv::Size chessboard_in(const cv::Mat& grey) {
  cv::Mat corners, meta;
  const int flags = cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_LARGER;
  if (!cv::findChessboardCornersSB(grey, {3, 3}, corners, flags, meta)) return {};
  return {std::max(meta.cols, meta.rows), std::min(meta.cols, meta.rows)};
}

}  // namespace perch
