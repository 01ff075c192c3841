#include <algorithm>
#include <array>
#include <map>
#include <opencv2/imgproc.hpp>

#include "calib/camera/board_finder.h"
#include "calib/camera/edge_width.h"
#include "perch/detection/apriltag_detector.h"

namespace perch {
namespace {

double level(const cv::Mat& grey, const Eigen::Vector2d& p) {
  const int x = std::clamp(static_cast<int>(std::lround(p.x())), 0, grey.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(p.y())), 0, grey.rows - 1);
  return grey.at<uint8_t>(y, x);
}

// Whether it is dark beyond the corner too, as on Kalibr's grids, which have a black square there.
bool four_areas_meet(const cv::Mat& grey, const Eigen::Vector2d& corner, const Eigen::Vector2d& middle,
                     double side) {
  const Eigen::Vector2d outwards = 0.14 * side * (corner - middle).normalized();
  const Eigen::Vector2d aside(-outwards.y(), outwards.x());
  const double dark = std::max(level(grey, corner - outwards), level(grey, corner + outwards));
  return std::min(level(grey, corner - aside), level(grey, corner + aside)) > dark + 15;
}

// libapriltag's corners are those of straight lines along the tag's sides; where four areas meet the place is
// known better, as on a chessboard. The search there finds nothing of use at a corner of the tag alone: 0.15
// px outwards. Empty: too near to the picture's edge, or something else lies there.
std::optional<Eigen::Vector2d> refined(const cv::Mat& grey, const Eigen::Vector2d& corner,
                                       const Eigen::Vector2d& middle, double side) {
  // The next thing is a gap (0.3 of the tag) or a module of a border (0.2 or 0.125) away.
  const int reach = std::clamp(static_cast<int>(0.1 * side), 2, 6);
  const double margin = reach + 3;
  if (!(corner.x() > margin && corner.y() > margin && corner.x() < grey.cols - 1 - margin &&
        corner.y() < grey.rows - 1 - margin)) {
    return std::nullopt;
  }
  if (!four_areas_meet(grey, corner, middle, side)) return corner;
  std::vector<cv::Point2f> points{{static_cast<float>(corner.x()), static_cast<float>(corner.y())}};
  cv::cornerSubPix(grey, points, {reach, reach}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  const Eigen::Vector2d found(points[0].x, points[0].y);
  if ((found - corner).norm() > 0.7 * reach) return std::nullopt;
  return found;
}

// What is found at full and at half size differs, and a picture of a calibration has all the time: both are
// taken.
class TagsFinder : public BoardFinder {
 public:
  explicit TagsFinder(const TargetBoard& board) : board_(board) {
    for (const double decimate : {1.0, 2.0}) {
      AprilTagOptions options;
      options.quad_decimate = decimate;
      detectors_.push_back(
          std::make_unique<AprilTagDetector>(std::get<AprilTagBoard>(board.target.layout), options));
    }
  }

  BoardSighting find(const cv::Mat& grey) override {
    std::map<int, std::array<Eigen::Vector2d, 4>> tags;
    for (const auto& detector : detectors_) {
      const auto& c = detector->detect(grey, std::nullopt).correspondences;
      for (size_t i = 0; i + 3 < c.size(); i += 4) {
        tags.try_emplace(c[i].feature,
                         std::array{c[i].pixel, c[i + 1].pixel, c[i + 2].pixel, c[i + 3].pixel});
      }
    }
    BoardSighting sighting;
    for (const auto& [first, corners] : tags) {
      const double side = std::min((corners[0] - corners[1]).norm(), (corners[0] - corners[3]).norm());
      const Eigen::Vector2d middle = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
      for (size_t k = 0; k < 4; ++k) {
        const GridPlace& place = board_.places[static_cast<size_t>(first) + k];
        if (const auto pixel = refined(grey, corners[k], middle, side)) {
          sighting.corners.push_back({place.column, place.row, *pixel, 1});
        }
      }
    }
    std::sort(sighting.corners.begin(), sighting.corners.end(), [](const auto& a, const auto& b) {
      return std::pair(a.row, a.column) < std::pair(b.row, b.column);
    });
    // mrcal's poses need six corners.
    if (sighting.corners.size() < 8) {
      sighting.problem = (sighting.corners.empty() ? "no tag of " : "no second tag of ") + board_.target.name;
      sighting.corners.clear();
    }
    sighting.blur_px = edge_width(grey, sighting.corners);
    return sighting;
  }

 private:
  TargetBoard board_;
  std::vector<std::unique_ptr<AprilTagDetector>> detectors_;
};

}  // namespace

std::unique_ptr<BoardFinder> make_tags_finder(const TargetBoard& board) {
  return std::make_unique<TagsFinder>(board);
}

}  // namespace perch
