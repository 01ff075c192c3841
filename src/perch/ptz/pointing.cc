#include "perch/ptz/pointing.h"

#include <Eigen/Geometry>
#include <cmath>

namespace perch {

std::optional<HeadAngles> angles_to_see_at(const Eigen::Vector3d& direction_in_zero,
                                           const Eigen::Vector3d& desired_ray) {
  const Eigen::Vector3d d = direction_in_zero.normalized(), r = desired_ray.normalized();
  // (Rx(tilt) r).y = d.y fixes the tilt, the angles in the horizontal plane then the pan.
  const double vertical = std::hypot(r.y(), r.z());
  if (!(std::abs(d.y()) < vertical)) return std::nullopt;
  HeadAngles angles;
  angles.tilt = std::atan2(r.y(), r.z()) - std::asin(d.y() / vertical);
  const double z = std::sin(angles.tilt) * r.y() + std::cos(angles.tilt) * r.z();
  angles.pan = std::remainder(std::atan2(d.x(), d.z()) - std::atan2(r.x(), z), 2 * M_PI);
  return angles;
}

Eigen::Vector3d zero_from_camera(const HeadAngles& angles, const Eigen::Vector3d& ray) {
  return Eigen::AngleAxisd(angles.pan, Eigen::Vector3d::UnitY()) *
         (Eigen::AngleAxisd(angles.tilt, Eigen::Vector3d::UnitX()) * ray);
}

std::optional<HeadAngles> angles_between(const CameraModel& camera, const HeadAngles& now,
                                         const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px) {
  const auto from = camera.ray_from_pixel(from_px), to = camera.ray_from_pixel(to_px);
  if (!from || !to) return std::nullopt;
  const auto goal = angles_to_see_at(zero_from_camera(now, *from), *to);
  if (!goal) return std::nullopt;
  return HeadAngles{std::remainder(goal->pan - now.pan, 2 * M_PI), goal->tilt - now.tilt};
}

}  // namespace perch
