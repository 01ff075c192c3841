#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "perch/camera/camera_model.h"

namespace perch {

// How the target's plane is seen, as a homography that is being corrected:
// (x, y, 1) ~ image_from_plane * (q, 1), with q in m and (x, y) of an ideal camera (pixels undistorted and
// divided by depth).
//
// A correction is eight numbers D about a frame of the image in which the target has about unit size:
// H' = S^-1 (I + [D0 D1 D2; D3 D4 D5; D6 D7 0]) S H. To first order a point u of that frame moves by
//   (D0 ux + D1 uy + D2 - ux (D6 ux + D7 uy), D3 ux + D4 uy + D5 - uy (D6 ux + D7 uy)).
using PlaneStep = Eigen::Matrix<double, 8, 1>;
using PlaneInformation = Eigen::Matrix<double, 8, 8>;

struct ImageFrame {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 1;

  Eigen::Matrix3d from_image() const {
    Eigen::Matrix3d S;
    S << 1 / radius, 0, -centre.x() / radius, 0, 1 / radius, -centre.y() / radius, 0, 0, 1;
    return S;
  }
  Eigen::Matrix3d to_image() const {
    Eigen::Matrix3d S;
    S << radius, 0, centre.x(), 0, radius, centre.y(), 0, 0, 1;
    return S;
  }
};

Eigen::Matrix3d corrected(const Eigen::Matrix3d& image_from_plane, const ImageFrame& frame,
                          const PlaneStep& step);

// The step from one homography to another, the inverse of `corrected`.
PlaneStep step_between(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to, const ImageFrame& frame);

// How the distance along a direction of the picture changes with a step: `gradient` is that of the distance
// by the point's place in the ideal image (px).
PlaneStep step_jacobian(const Eigen::Vector2d& image, const Eigen::Vector2d& gradient,
                        const ImageFrame& frame);

// An edge was found `offset` px from where it was expected, towards its white side.
struct EdgeOffset {
  PlaneStep jacobian;     // of the expected place, along the same direction
  double offset = 0;      // px
  double sigma = 1;       // px
  double white = 0;       // how an edge moves when white grows by one px: -1 along its normal
  double outline = 0;     // the same by what the outline grows otherwise
  double modulation = 0;  // of the step: its height as a part of its upper level
  double weight = 1;      // of the robust loss
  double left = 0;        // of the offset, once it is fitted, px
};

struct PlaneFit {
  PlaneStep step = PlaneStep::Zero();
  double growth = 0;  // by how much white has grown on every side (blooming), px
  // Of the step, the growth accounted for, in units of the offsets' sigmas.
  PlaneInformation information = PlaneInformation::Zero();
  double scale = 1;   // robust standard deviation of offsets in sigmas
  double rms_px = 0;  // of the offsets left, weighted by the loss
};

// Least squares with Cauchy's loss over the offsets, in `rounds` of reweighting, whose weights it leaves in
// them. Sums are of floats: a step is known to a thousandth of itself, which the next one corrects. The
// perspective (D6, D7), which a small target shows hardly, is held by what is possible at all: `steepest`,
// the tangent of the greatest tilt. The outline's own growth is held to a third of the common one.
PlaneFit fit_plane(std::vector<EdgeOffset>& offsets, const ImageFrame& frame, double sigma_growth, int rounds,
                   double steepest = 3);

}  // namespace perch
