#include "perch/frames/frame_chain.h"

#include <cmath>

#include "perch/geometry/euler.h"

namespace perch {

FrameChain read_frame_chain(Section frames) {
  FrameChain chain;
  if (frames.has("base_from_camera") && frames.is_mapping_with("base_from_camera", "pan_tilt")) {
    Section base = frames.section("base_from_camera");
    Section head = base.section("pan_tilt");
    PanTilt pan_tilt;
    head.read("base_from_zero", pan_tilt.base_from_zero);
    head.done();
    base.done();
    chain.pan_tilt = pan_tilt;
  } else {
    frames.read("base_from_camera", chain.base_from_camera);
  }
  frames.read("body_from_base", chain.body_from_base);
  frames.read("target_from_pad", chain.target_from_pad);
  frames.read("world_from_pad", chain.world_from_pad);
  // Clocks further apart are not offset but unrelated; no flight lasts longer than a day.
  frames.read("time_offset", chain.time_offset, Range{-86400, 86400});
  frames.done();
  return chain;
}

Rigid3 base_from_camera(const FrameChain& chain, const std::optional<HeadAngles>& angles) {
  if (!chain.pan_tilt) return chain.base_from_camera;
  const HeadAngles a = angles.value_or(HeadAngles{});
  const Eigen::Quaterniond pan(Eigen::AngleAxisd(a.pan, Eigen::Vector3d::UnitY()));
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(a.tilt, Eigen::Vector3d::UnitX()));
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(a.roll, Eigen::Vector3d::UnitZ()));
  return chain.pan_tilt->base_from_zero * Rigid3{pan * tilt * roll, Eigen::Vector3d::Zero()};
}

std::optional<HeadAngles> head_angles_of(const FrameChain& chain,
                                         const Eigen::Quaterniond& body_from_camera) {
  if (!chain.pan_tilt || !body_from_camera.coeffs().allFinite()) return std::nullopt;
  // What a head that is stiff and level may be off; five metres away it is 17 cm.
  constexpr double kMostLeft = 2 * kRadFromDeg;
  const Eigen::Quaterniond body_from_base =
      chain.body_from_base ? chain.body_from_base->rotation : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond turned =
      (body_from_base * chain.pan_tilt->base_from_zero.rotation).conjugate() * body_from_camera;
  const Eigen::Matrix3d R = turned.toRotationMatrix();  // Ry(pan) Rx(tilt)
  HeadAngles angles;
  angles.pan = std::atan2(-R(2, 0), R(0, 0));
  const Eigen::Quaterniond pan(Eigen::AngleAxisd(angles.pan, Eigen::Vector3d::UnitY()));
  const Eigen::Matrix3d rest = (pan.conjugate() * turned).toRotationMatrix();
  angles.tilt = std::atan2(rest(2, 1), rest(1, 1));
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(angles.tilt, Eigen::Vector3d::UnitX()));
  if (!((pan * tilt).angularDistance(turned) < kMostLeft)) return std::nullopt;
  return angles;
}

namespace {

// Of a small turn of the head: numeric, so that it holds for axes that do not meet, too. The error is that of
// a central difference, 1e-9 of the lever arm and the angle.
PoseCovariance head_covariance(const FrameChain& chain, const HeadAngles& at) {
  constexpr double kStep = 1e-4;  // rad
  const auto derivative = [&](double pan, double tilt) {
    const Rigid3 less = base_from_camera(chain, HeadAngles{at.pan - pan, at.tilt - tilt, 0, 0, at.roll});
    const Rigid3 more = base_from_camera(chain, HeadAngles{at.pan + pan, at.tilt + tilt, 0, 0, at.roll});
    return PoseError(pose_error(less, more) / (2 * kStep));
  };
  const PoseError by_pan = at.pan_sigma * derivative(kStep, 0);
  const PoseError by_tilt = at.tilt_sigma * derivative(0, kStep);
  return by_pan * by_pan.transpose() + by_tilt * by_tilt.transpose();
}

UncertainRigid3 camera_from_body(const FrameChain& chain, const std::optional<HeadAngles>& angles) {
  UncertainRigid3 head{base_from_camera(chain, angles)};
  if (chain.pan_tilt && angles) head.covariance = head_covariance(chain, *angles);
  return inverse(UncertainRigid3{chain.body_from_base.value_or(Rigid3{})} * head);
}

}  // namespace

UncertainRigid3 pad_from_body_by_vision(const FrameChain& chain, const UncertainRigid3& camera_from_target,
                                        const std::optional<HeadAngles>& angles) {
  return UncertainRigid3{inverse(chain.target_from_pad)} * inverse(camera_from_target) *
         camera_from_body(chain, angles);
}

UncertainRigid3 camera_from_target_of(const FrameChain& chain, const UncertainRigid3& pad_from_body,
                                      const std::optional<HeadAngles>& angles) {
  return camera_from_body(chain, angles) * inverse(pad_from_body) *
         UncertainRigid3{inverse(chain.target_from_pad)};
}

std::optional<Eigen::Vector3d> level_normal_in_camera(const FrameChain& chain,
                                                      const Eigen::Quaterniond& world_from_body,
                                                      const std::optional<HeadAngles>& angles) {
  const Eigen::Quaterniond camera_from_world =
      camera_from_body(chain, angles).mean.rotation * world_from_body.conjugate();
  if (!camera_from_world.coeffs().allFinite()) return std::nullopt;
  if (chain.world_from_pad) {
    const Eigen::Quaterniond world_from_target =
        chain.world_from_pad->rotation * chain.target_from_pad.rotation.conjugate();
    return camera_from_world * (world_from_target * Eigen::Vector3d::UnitZ());
  }
  const Eigen::Vector3d vertical = camera_from_world * Eigen::Vector3d::UnitZ();
  // 20 degrees: a target in the picture lies up to that far beside the axis of most lenses.
  if (std::abs(vertical.z()) < std::sin(20 * kRadFromDeg)) return std::nullopt;
  return vertical.z() < 0 ? vertical : Eigen::Vector3d(-vertical);
}

std::optional<Rigid3> pad_from_body_by_navigation(const FrameChain& chain, const Rigid3& world_from_body) {
  if (!chain.world_from_pad) return std::nullopt;
  return inverse(*chain.world_from_pad) * world_from_body;
}

}  // namespace perch
