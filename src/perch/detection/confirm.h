#pragma once

#include <array>
#include <bitset>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perch/detection/edge_search.h"
#include "perch/detection/grey_order.h"

namespace perch {

// Of a target; more squares than anyone can tell apart.
inline constexpr size_t kMostShapes = 128;

// A homography that the picture's edges confirm: enough of what should be seen is, and no square's place is
// plain black, as no square was ever there.
struct Confirmed {
  Eigen::Matrix3d image_from_plane = Eigen::Matrix3d::Identity();
  ImageFrame frame;
  int found = 0, asked = 0;       // lines
  double own = 0;                 // part found of those not across the outline: the ground may be as pale
  int partly = 0;                 // squares that are neither there nor hidden
  double blur = 0.8;              // deviation across edges, px
  double contrast = 0;            // median of the steps, grey levels
  std::bitset<kMostShapes> seen;  // by shape: enough of its edges are
  bool by_one_look = false;       // see Requirement
  double score() const { return 2.0 * found - asked; }
};

// How much must be seen.
struct Requirement {
  int squares = 3;       // whole ones
  int border_edges = 2;  // sides of the border's edges, or of the hole's
  double found = 0.5;    // of the lines across squares and the border's inner edge
  double contrast = 12;  // grey levels
  // Whether one look will do where it finds nearly all of a target that is in view as a whole, as its edges
  // will be measured, which says more than a second look.
  bool is_measured_after = false;
};

// Of the median contrast: what is less is noise, not an edge in the shadow.
inline constexpr double kLeastOfContrast = 0.18;

// Grey levels in and around a square's place.
struct SquareLevels {
  double inside = 0, around = 0;
  double pale_around = 0;  // part of the places around that are nearer to white than to black
};

// Looks for every edge of the target about where a homography puts it, corrects the homography, and says
// whether it is one. Holds its working memory.
class Confirmation {
 public:
  Confirmation(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera);

  // `radius`: how far off the homography's edges may be, px.
  std::optional<Confirmed> confirm(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane,
                                   double radius, const Requirement& requirement);

  // Whether the last picture was clearly that of another panel: squares lie beside the places of ours, or
  // edges that are wholly there or not at all are too few or show another layout.
  bool is_contradicted() const { return contradicted_; }

  // Whether the target's smallest squares, not counting a nested one's, are too small for their edges to be
  // told apart.
  bool has_small_squares(const ImageFrame& frame) const;

 private:
  bool is_plain(const ImageFrame& frame, int lines) const;
  bool is_met(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane, const Requirement& requirement);
  bool is_clear() const;
  bool is_whole(size_t shape, int lines) const;
  std::optional<SquareLevels> levels_of(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane,
                                        const TargetShape& square) const;
  std::optional<int> grey_at(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane,
                             const Eigen::Vector2d& point) const;
  bool is_beside(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane, const TargetShape& square,
                 double contrast) const;
  bool is_layout(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane) const;

  TargetEdges target_;
  CameraModel camera_;
  GreyOrder grey_order_;
  double size_;     // m
  double own_ = 0;  // as in Confirmed
  int partly_ = 0;
  std::array<double, 2> smallest_{};  // square of the target, of the nested one in it, m
  bool contradicted_ = false;
  std::vector<EdgePiece> pieces_;
  std::vector<EdgeOffset> offsets_;
  std::vector<FoundStep> steps_;
  std::vector<EdgeTally> tallies_, in_order_;
  std::vector<double> widths_;
  std::bitset<kMostShapes> seen_;  // as in Confirmed
};

// The part of the ideal image that the target takes up.
ImageFrame frame_of(const Eigen::Matrix3d& image_from_plane, const Eigen::Vector2d& centre, double size);

}  // namespace perch
