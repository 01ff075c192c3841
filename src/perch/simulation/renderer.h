#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>

#include "perch/camera/camera_model.h"
#include "perch/geometry/rigid3.h"
#include "perch/simulation/ground.h"
#include "perch/simulation/patch_map.h"
#include "perch/simulation/point_spread.h"
#include "perch/simulation/ray_grid.h"
#include "perch/target/landing_target.h"

namespace perch {

// A half-plane of the target's plane in shadow: where n . p < distance + speed * time, n = (cos, sin) of
// `direction`.
struct ShadowEdge {
  double direction = 0;  // rad, from the target's x axis, out of the shadow
  double distance = 0;   // of the edge from the target's origin, m
  double speed = 0;      // m/s
  double factor = 0.3;   // light left in the shadow: that of the sky
  double penumbra =
      0.03;  // width of the soft edge, m: 1 % of the height of what casts it (the sun's half degree)
};

struct SceneOptions {
  double white = 0.8;  // reflectance of paper or paint
  double black = 0.05;
  double illumination = 1;
  GroundOptions ground;
  std::optional<ShadowEdge> shadow;
};

struct OpticsOptions {
  double psf_sigma_px = 0.6;  // a good lens in focus, its demosaicing included
  double vignetting = 0.6;    // 0: none, 1: cos^4 of the angle to the optical axis
};

struct ShutterOptions {
  double exposure = 0.002;  // s
  double readout = 0;       // from the first row's middle of exposure to the last row's, s; 0: global shutter
  bool motion_blur = false;  // average over the exposure; costs a rendering for each quarter pixel of motion
};

// camera_from_target at a time in s after the middle of the exposure (of the middle row).
using PoseAt = std::function<Rigid3(double)>;

// Renders a target lying on textured ground, seen by a camera, exactly: each pixel is the mean of the scene
// over the pixel's footprint, by areas of polygons and not by point samples, spread by the lens's blur.
// Shares no code with what detects and measures targets, so that either can accuse the other.
//
// The ground is the target's plane z = 0. Assumptions within one pixel: ground and shadow are those at its
// centre, its four sides are straight in the target's plane.
//
// Costs some 100 ms to make (the lens is inverted, the ground grown) and then 20 to 30 ms a picture of
// 640x480. Const calls may run in several threads.
class Renderer {
 public:
  Renderer(const CameraModel& camera, const LandingTarget& target, const SceneOptions& scene = {},
           const OpticsOptions& optics = {});

  // The light on each pixel, without noise: 1 is what a surface of reflectance 1 under illumination 1 gives
  // in the middle of the picture. Rays that miss the plane see the sky; pixels without a ray are 0. `time`
  // moves the shadow, s.
  cv::Mat_<float> radiance(const Rigid3& camera_from_target, double time = 0) const;
  cv::Mat_<float> radiance(const PoseAt& camera_from_target, const ShutterOptions& shutter,
                           double time = 0) const;

  const CameraModel& camera() const { return camera_; }

 private:
  struct Layers;

  template <typename PoseOfRow>
  cv::Mat_<float> expose(const PoseOfRow& pose_of_row, bool one_pose, double time) const;
  std::optional<Coverage> one_colour(const Quad& corners, const Eigen::Vector2d& centre, double radius) const;
  double light(const Coverage& coverage, const Eigen::Vector2d& point, double size) const;
  double shadow(const Eigen::Vector2d& point, double size, double time) const;
  void shade_cells(const Quad& corners, const Eigen::Vector2d& centre, double size, int column, int row,
                   double time, Layers& layers) const;
  double motion_px(const PoseAt& camera_from_target, const ShutterOptions& shutter) const;

  CameraModel camera_;
  SceneOptions scene_;
  Eigen::Vector2d shadow_normal_;
  PatchMap patches_;
  Ground ground_;
  PointSpread spread_;
  RayGrid rays_;
  cv::Mat_<float> vignette_;
};

}  // namespace perch
