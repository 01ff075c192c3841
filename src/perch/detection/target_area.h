#pragma once

#include <Eigen/Geometry>

#include "perch/camera/camera_model.h"
#include "perch/detection/confirm.h"
#include "perch/detection/quads.h"

namespace perch {

// The part of the picture that a confirmed target takes up.
class TargetArea {
 public:
  TargetArea(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera,
             const Confirmed& found);

  // Whether a pixel lies on the target.
  bool holds(const Eigen::Vector2d& pixel) const;

  // Whether it may: a box around the target.
  bool may_hold(const Eigen::Vector2d& pixel) const { return box_.contains(pixel); }

  // Whether a region is a white four-sided one in the black interior that is no square of the target, nor a
  // piece of one, nor what covers one: then it is another panel, of which some squares happen to lie where
  // ours do.
  bool is_stranger(const WhiteQuad& quad) const;

  // Whether the region is of about a square's size, and too far off the middle of its place to be it.
  bool is_beside(const WhiteQuad& quad) const;

  // The square that was not seen and in which a four-sided region lies, much smaller than it.
  std::optional<size_t> piece_of(const WhiteQuad& quad) const;

 private:
  std::optional<Eigen::Vector2d> on_plane(const Eigen::Vector2d& pixel) const;
  bool is_hidden(size_t shape) const;

  const TargetEdges& edges_;
  const CameraModel& camera_;
  const Confirmed& found_;
  double size_, interior_ = 0, smallest_;  // m
  double px2_per_m2_ = 0;                  // at the target's middle
  double px_;                              // one pixel on the plane where it is seen shortest, m
  Eigen::Matrix3d plane_from_image_;
  Eigen::AlignedBox2d box_;  // px, around all of it
};

}  // namespace perch
