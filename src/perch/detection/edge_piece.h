#pragma once

#include <Eigen/Core>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/target/edges.h"

namespace perch {

// A piece of an edge of the target as it is expected in the picture: an arc, since a lens bends straight
// lines, through three points.
struct EdgePiece {
  int edge = 0;                                      // index of the target's edge
  Eigen::Vector2d image = Eigen::Vector2d::Zero();   // its middle in the ideal image
  Eigen::Vector2d begin, middle, end;                // px
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();  // unit, towards white, px
  Eigen::Vector2d gradient =
      Eigen::Vector2d::Zero();            // of a place along the normal (px) by the ideal image's
  double white_room = 0, black_room = 0;  // to the next edges, px
  bool first = false, last = false;       // holds the edge's own end
  double length() const { return (end - begin).norm(); }
  // The place in the ideal image of a part of the piece, 0 at begin, 1 at end.
  Eigen::Vector2d image_at(double part) const {
    const Eigen::Vector2d along(-normal.y(), normal.x()), in_image(-gradient.y(), gradient.x());
    return image + in_image * ((part - 0.5) * along.dot(end - begin) / gradient.squaredNorm());
  }
};

// The homography with the sign that puts the plane's origin before the camera.
Eigen::Matrix3d towards_camera(const Eigen::Matrix3d& image_from_plane);

// Not cut at all.
inline constexpr double kWhole = 1e9;

// All edges of which something is in view, cut into pieces of at most `longest` px, and into two at least
// where that leaves twelve px of each, unless they are to be whole. Replaces `pieces`.
void project_edges(const TargetEdges& target, const Eigen::Matrix3d& image_from_plane,
                   const CameraModel& camera, double longest, std::vector<EdgePiece>& pieces);

// The lines of the pixel raster that cross a piece: rows where it is steep, columns where it is flat.
class CrossingLines {
 public:
  // `trim` px are left out at the edge's own ends, where corners bend the profile.
  CrossingLines(const EdgePiece& piece, double trim);

  bool rows() const { return rows_; }
  int first() const { return first_; }
  int last() const { return last_; }  // inclusive; less than first() when there are none
  // Where the edge crosses the line: x of a row, y of a column.
  double crossing(int line) const {
    const double u = (line - begin_) * per_line_;
    return start_ + u * (run_ + bend_ * (1 - u));
  }
  double part(int line) const { return (line - begin_) * per_line_; }  // 0 at begin, 1 at end
  // From a distance along the line to one along the normal, px; negative when white is on the left (above).
  double along_normal() const { return along_normal_; }

 private:
  bool rows_;
  int first_, last_;
  double begin_, per_line_, start_, run_, bend_, along_normal_;
};

}  // namespace perch
