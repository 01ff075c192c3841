#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/hal/intrin.hpp>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/detection/plane_fit.h"
#include "perch/target/edges.h"

namespace perch {

// What the grey levels of a small target's picture depend on.
struct PictureParameters {
  Eigen::Matrix2d blur = Eigen::Matrix2d::Identity();  // covariance of a point's image, px^2
  double growth = 0, outline_growth = 0;               // as in plane_fit.h, px
  // Levels at the target's middle, and how they change over a unit of the frame, grey levels.
  Eigen::Vector3d white = Eigen::Vector3d::Zero(), ground = Eigen::Vector3d::Zero();
  double black = 0;
};

// Four pixels beside each other, a lane each, as rows of the picture's least squares: a pixel's derivatives
// by all of them, and what is left of its level.
struct PictureRows {
  using Four = cv::v_float32x4;
  static constexpr int kPixels = 4;
  static constexpr int kStep = 0, kBlur = 8, kGrowth = 11, kWhite = 13, kBlack = 16, kGround = 17;
  static constexpr int kUnknowns = 20, kResidual = 20, kColumns = 21;
  std::array<Four, kColumns> d;  // where all are flat, those of step, blur and growth are not set
  Four ground;                   // how much of a pixel is ground
  Four asked;        // all bits set; none: beyond the last column, or farther off than the levels are worth
  Four crossed;      // the same: an edge is near
  bool flat = true;  // no edge is near any of them
};

// The picture of a target of squares as its grey levels, from a homography, blur and three levels: each shape
// is an area between four edges, straight but for the lens's distortion, spread by a Gaussian. The chance
// that a point of it is inside is the product of those of both pairs of edges, and what adjacent edges that
// are not at right angles have in common (the series of the bivariate normal distribution, to third order:
// where edges meet at 45 degrees, half a percent of the step is left out).
class PictureModel {
 public:
  PictureModel(const TargetEdges& edges, const CameraModel& camera) : edges_(edges), camera_(camera) {}

  // False when not all of the target is before the camera and in its picture. Within one edge a lens's
  // distortion is a parabola: this is for targets of less than a hundred px.
  bool set(const Eigen::Matrix3d& image_from_plane, const ImageFrame& frame,
           const PictureParameters& parameters);

  // The rows and columns in which something of the target is seen, with `margin` px around it.
  int first_row() const { return static_cast<int>(low_.y()); }
  int last_row() const { return static_cast<int>(high_.y()); }
  int first_column() const { return static_cast<int>(low_.x()); }
  int last_column() const { return static_cast<int>(high_.x()); }

  // Of the pixels from (x, y) on. False when none of them is asked for.
  bool rows_of(int x, int y, const cv::v_float32x4& grey, PictureRows& rows) const;

 private:
  struct Edge {
    float nx, ny, offset;  // distance from the edge, inwards: n . p + offset, px
    float per_sigma;       // 1 / blur across it, px
    float tx, ty, start;   // the part of the edge beside p, 0 to 1: t . p + start
    float bend;            // at the part t its place is bend t (1 - t) inwards of its chord, px
    float by_blur[3];      // of sigma by the blur's mean square, stretch along the axes and the diagonals
    std::array<float, 8> from, to;  // of the distance by a step, at the edge's ends
  };
  struct Shape {
    std::array<Edge, 4> edges;
    std::array<float, 4> corner;                         // correlation of edge k and k + 1 through the blur
    std::array<std::array<float, 3>, 4> corner_by_blur;  // of that, as Edge::by_blur
    float low_x, low_y, high_x, high_y;
    float white = 1;      // 1: white on what is around it, -1: black
    bool ground = false;  // what is around it is the ground
    float room = 1e9F;    // outside, beyond which nothing is asked of a pixel, px
  };

  const TargetEdges edges_;
  CameraModel camera_;
  std::vector<Shape> shapes_;
  PictureParameters parameters_;
  Eigen::Vector2d low_, high_, middle_;  // px
  double per_px_ = 1;                    // units of the frame
  bool has_ground_ = true;               // an outline that may be measured
};

}  // namespace perch
