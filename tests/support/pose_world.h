#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/detection/detector.h"
#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "perch/geometry/uncertainty.h"
#include "perch/target/landing_target.h"
#include "support/rng.h"

namespace perch {

// The world of the pose tests and benchmarks: a camera, poses it sees a target from, and what it then
// measures.

// 640 x 480, f = 600 px: 56 degrees wide, with the barrel distortion of such a lens.
inline CameraModel wide_camera() {
  return CameraModel("LENSMODEL_OPENCV5", {600, 602, 322, 238, -0.28, 0.09, 6e-4, -4e-4, -0.01}, 640, 480);
}

// The target `range` away in the direction `towards` (unit, camera axes), its face turned by `tilt` from
// facing the camera about an axis `about` around the line of sight, and by `yaw` in itself.
inline Rigid3 view(double range, const Eigen::Vector3d& towards, double tilt, double about, double yaw) {
  // Eigen's FromTwoVectors would have each of the ten tests compile a singular value decomposition.
  const Eigen::Vector3d sideways = Eigen::Vector3d::UnitZ().cross(towards);
  const Eigen::Quaterniond line_of_sight =
      so3_exp(std::atan2(sideways.norm(), towards.z()) * sideways.normalized());
  const Eigen::AngleAxisd turned(tilt, Eigen::Vector3d(std::cos(about), std::sin(about), 0));
  // Facing the camera: x right, y up, z towards it.
  const Eigen::AngleAxisd facing(M_PI, Eigen::Vector3d::UnitX());
  const Eigen::AngleAxisd in_itself(yaw, Eigen::Vector3d::UnitZ());
  return {(line_of_sight * turned * facing * in_itself).normalized(), range * towards};
}

// The same from a random side, within 0.1 rad of the camera's axis: the whole of a 1 m target is in the
// picture of wide_camera() from 1.7 m on.
inline Rigid3 random_view(TestRng& rng, double range, double tilt) {
  const Eigen::Vector3d towards(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 1);
  return view(range, towards.normalized(), tilt, rng.uniform(-M_PI, M_PI), rng.uniform(-M_PI, M_PI));
}

inline PoseError random_error(TestRng& rng, double m, double rad) {
  PoseError error;
  error << rng.normal3(m), rng.normal3(rad);
  return error;
}

// All features of the target with Gaussian noise; `sigma_px` is what they claim, `noise_px` what they have.
inline std::vector<Correspondence> seen(const LandingTarget& target, const CameraModel& camera,
                                        const Rigid3& camera_from_target, TestRng& rng, double noise_px,
                                        double sigma_px) {
  std::vector<Correspondence> correspondences;
  for (size_t i = 0; i < target.features.size(); ++i) {
    const Eigen::Vector2d& point = target.features[i].point;
    const auto pixel =
        camera.pixel_from_camera(camera_from_target * Eigen::Vector3d(point.x(), point.y(), 0));
    if (!pixel) continue;
    const Eigen::Vector2d noise(rng.normal(noise_px), rng.normal(noise_px));
    correspondences.push_back({static_cast<int>(i), *pixel + noise, sigma_px});
  }
  return correspondences;
}

// Points of the target's plane and of the ideal camera's image, as the linear algorithm takes them.
struct PlaneAndImage {
  std::vector<Eigen::Vector2d> plane, image;
};

inline PlaneAndImage ideal_view(const LandingTarget& target, const Rigid3& camera_from_target, TestRng& rng,
                                double noise) {
  PlaneAndImage points;
  for (const auto& feature : target.features) {
    const Eigen::Vector3d p = camera_from_target * Eigen::Vector3d(feature.point.x(), feature.point.y(), 0);
    points.plane.push_back(feature.point);
    points.image.push_back(p.hnormalized() + Eigen::Vector2d(rng.normal(noise), rng.normal(noise)));
  }
  return points;
}

}  // namespace perch
