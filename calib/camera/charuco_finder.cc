#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "calib/camera/board_finder.h"
#include "calib/camera/edge_width.h"
#include "perch/geometry/homography.h"

namespace perch {
namespace {

// A homography of a few squares is off by what the lens bends over them: half of this part of a square.
constexpr double kWindow = 0.3;

// How far from a corner the markers may be that say where it is, in squares.
constexpr double kNear = 1.8;

// Between the dark and the light squares at a corner, grey levels.
constexpr int kLeastContrast = 15;

constexpr std::array<const char*, 21> kDictionaries = {
    "4X4_50",        "4X4_100",        "4X4_250",       "4X4_1000", "5X5_50",         "5X5_100",
    "5X5_250",       "5X5_1000",       "6X6_50",        "6X6_100",  "6X6_250",        "6X6_1000",
    "7X7_50",        "7X7_100",        "7X7_250",       "7X7_1000", "ARUCO_ORIGINAL", "APRILTAG_16h5",
    "APRILTAG_25h9", "APRILTAG_36h10", "APRILTAG_36h11"};

cv::Ptr<cv::aruco::Dictionary> dictionary_of(const std::string& name) {
  const auto* it = std::find(kDictionaries.begin(), kDictionaries.end(), name);
  if (it != kDictionaries.end())
    return cv::aruco::getPredefinedDictionary(static_cast<int>(it - kDictionaries.begin()));
  std::string names;
  for (const char* known : kDictionaries) names += std::string(" ") + known;
  throw std::invalid_argument("expected one of OpenCV's dictionaries:" + names + "; found \"" + name + '"');
}

// The square of each marker, ids by rows. OpenCV has a marker in the white ones; the upper left one is black
// by its later habit, and of an even number of rows white by its earlier one.
std::vector<Eigen::Vector2d> marker_squares(const CharucoBoard& board, bool first_is_white) {
  std::vector<Eigen::Vector2d> squares;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      if ((row + column) % 2 == (first_is_white ? 0 : 1)) squares.emplace_back(column, row);
    }
  }
  return squares;
}

struct Marker {
  int id = 0;
  std::array<Eigen::Vector2d, 4> pixels;  // upper left, upper right, lower right, lower left
};

// Corners of markers on the board, in squares from its upper left, and in the picture.
struct Pairs {
  std::vector<Eigen::Vector2d> board, pixel;

  void add(const Marker& marker, const Eigen::Vector2d& square, double side) {
    const double low = 0.5 - side / 2, high = 0.5 + side / 2;
    const std::array<Eigen::Vector2d, 4> corners = {{{low, low}, {high, low}, {high, high}, {low, high}}};
    for (size_t k = 0; k < 4; ++k) {
      board.push_back(square + corners[k]);
      pixel.push_back(marker.pixels[k]);
    }
  }
};

double median_error(const Pairs& pairs) {
  const auto H = homography_from_points(pairs.board, pairs.pixel);
  if (!H) return INFINITY;
  std::vector<double> errors;
  for (size_t i = 0; i < pairs.board.size(); ++i)
    errors.push_back((apply(*H, pairs.board[i]) - pairs.pixel[i]).norm());
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

class CharucoFinder : public BoardFinder {
 public:
  explicit CharucoFinder(const CharucoBoard& board)
      : board_(board),
        dictionary_(dictionary_of(board.dictionary)),
        parameters_(cv::aruco::DetectorParameters::create()) {
    for (const bool white : {false, true}) layouts_.push_back(marker_squares(board, white));
    if (static_cast<int>(std::min(layouts_[0].size(), layouts_[1].size())) > dictionary_->bytesList.rows) {
      throw std::invalid_argument(
          "expected a dictionary with as many markers as the board has white squares");
    }
    parameters_->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  }

  BoardSighting find(const cv::Mat& grey) override {
    BoardSighting sighting;
    const std::vector<Marker> markers = find_markers(grey);
    if (markers.empty()) {
      sighting.problem = "no marker of " + board_.dictionary;
      return sighting;
    }
    const auto& squares = layout_of(markers);
    for (int row = 0; row + 1 < board_.rows; ++row) {
      for (int column = 0; column + 1 < board_.columns; ++column) {
        if (const auto pixel = find_corner(grey, markers, squares, {column + 1, row + 1})) {
          sighting.corners.push_back({column, row, *pixel, 1});
        }
      }
    }
    if (sighting.corners.size() < 6) {
      sighting.corners.clear();
      sighting.problem = std::to_string(markers.size()) + " markers, too few for the corners between them";
    }
    sighting.blur_px = edge_width(grey, sighting.corners);
    return sighting;
  }

 private:
  std::vector<Marker> find_markers(const cv::Mat& grey) const {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(grey, dictionary_, corners, ids, parameters_);
    std::map<int, Marker> by_id;  // of an id seen twice neither can be trusted
    std::map<int, int> seen;
    for (size_t i = 0; i < ids.size(); ++i) {
      Marker marker{ids[i], {}};
      for (size_t k = 0; k < 4; ++k) marker.pixels[k] = {corners[i][k].x, corners[i][k].y};
      by_id[ids[i]] = marker;
      ++seen[ids[i]];
    }
    std::vector<Marker> markers;
    for (const auto& [id, marker] : by_id) {
      if (seen[id] == 1 && id < static_cast<int>(std::max(layouts_[0].size(), layouts_[1].size())))
        markers.push_back(marker);
    }
    return markers;
  }

  // The wrong one puts every other row's markers a square to the side.
  const std::vector<Eigen::Vector2d>& layout_of(const std::vector<Marker>& markers) const {
    size_t best = 0;
    double least = INFINITY;
    for (size_t i = 0; i < layouts_.size(); ++i) {
      Pairs pairs;
      for (const Marker& marker : markers) {
        const auto id = static_cast<size_t>(marker.id);
        if (id < layouts_[i].size()) pairs.add(marker, layouts_[i][id], board_.marker_of_square);
      }
      const double error = median_error(pairs);
      if (error < least) best = i;
      least = std::min(least, error);
    }
    return layouts_[best];
  }

  // Where the markers around say that it is, and then where four squares meet.
  std::optional<Eigen::Vector2d> find_corner(const cv::Mat& grey, const std::vector<Marker>& markers,
                                             const std::vector<Eigen::Vector2d>& squares,
                                             const Eigen::Vector2d& corner) const {
    Pairs pairs;
    bool touches = false;
    for (const Marker& marker : markers) {
      if (static_cast<size_t>(marker.id) >= squares.size()) continue;
      const Eigen::Vector2d& square = squares[static_cast<size_t>(marker.id)];
      const double distance = (square + Eigen::Vector2d(0.5, 0.5) - corner).cwiseAbs().maxCoeff();
      if (distance > kNear) continue;
      touches = touches || distance < 0.6;
      pairs.add(marker, square, board_.marker_of_square);
    }
    // Without a marker beside it nothing says that the corner is not covered.
    if (!touches) return std::nullopt;
    const auto H = homography_from_points(pairs.board, pairs.pixel);
    if (!H) return std::nullopt;
    const Eigen::Vector2d expected = apply(*H, corner);
    const double side = std::min((apply(*H, corner + Eigen::Vector2d(1, 0)) - expected).norm(),
                                 (apply(*H, corner + Eigen::Vector2d(0, 1)) - expected).norm());
    const int reach = std::clamp(static_cast<int>(kWindow * side * (1 - board_.marker_of_square) * 2), 2, 12);
    const double margin = reach + 3;
    if (!(expected.x() > margin && expected.y() > margin && expected.x() < grey.cols - 1 - margin &&
          expected.y() < grey.rows - 1 - margin)) {
      return std::nullopt;
    }
    std::vector<cv::Point2f> points{{static_cast<float>(expected.x()), static_cast<float>(expected.y())}};
    cv::cornerSubPix(grey, points, {reach, reach}, {-1, -1},
                     {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
    const Eigen::Vector2d found(points[0].x, points[0].y);
    if ((found - expected).norm() > 0.15 * side + 1 || !four_squares_meet(grey, *H, corner))
      return std::nullopt;
    return found;
  }

  // Dark and light in turns around the corner, this side of the markers: else something covers it.
  bool four_squares_meet(const cv::Mat& grey, const Eigen::Matrix3d& H, const Eigen::Vector2d& corner) const {
    const double away = std::min(0.6 * (1 - board_.marker_of_square) / 2, 0.15);
    std::array<int, 4> levels{};
    const std::array<Eigen::Vector2d, 4> around = {{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d p = apply(H, corner + away * around[k]);
      const int x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
      if (x < 0 || y < 0 || x >= grey.cols || y >= grey.rows) return false;
      levels[k] = grey.at<uint8_t>(y, x);
    }
    const auto [a, b] = std::minmax(levels[0], levels[2]);
    const auto [c, d] = std::minmax(levels[1], levels[3]);
    return std::max(a - d, c - b) > kLeastContrast;
  }

  CharucoBoard board_;
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  cv::Ptr<cv::aruco::DetectorParameters> parameters_;
  std::vector<std::vector<Eigen::Vector2d>> layouts_;
};

}  // namespace

std::unique_ptr<BoardFinder> make_charuco_finder(const CharucoBoard& board) {
  return std::make_unique<CharucoFinder>(board);
}

}  // namespace perch
