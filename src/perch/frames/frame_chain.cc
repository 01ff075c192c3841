#include "perch/frames/frame_chain.h"

#include <Eigen/QR>
#include <cmath>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"

namespace perch {

namespace {

HeadAxis read_axis(Section section, HeadAxis axis) {
  std::vector<double> direction(axis.direction.data(), axis.direction.data() + 3), point(3, 0.0);
  section.read("direction", direction, 3, Range{-1e3, 1e3});
  axis.direction = Eigen::Vector3d(direction.data());
  if (!(axis.direction.norm() > 1e-6)) section.fail("direction", "a vector of some length");
  axis.direction.normalize();
  section.read("point", point, 3, Range{-100, 100});
  axis.point = Eigen::Vector3d(point.data());
  section.read("scale", axis.scale, Range{0.1, 10});
  double zero_deg = 0;
  section.read("zero_deg", zero_deg, Range{-360, 360});
  axis.zero = zero_deg * kRadFromDeg;
  section.done();
  return axis;
}

PanTilt read_pan_tilt(Section head) {
  PanTilt pan_tilt;
  head.read("base_from_zero", pan_tilt.base_from_zero);
  pan_tilt.pan = read_axis(head.section("pan"), pan_tilt.pan);
  pan_tilt.tilt = read_axis(head.section("tilt"), pan_tilt.tilt);
  head.read_choice(
      "order", pan_tilt.order,
      {{"pan_carries_tilt", HeadOrder::kPanCarriesTilt}, {"tilt_carries_pan", HeadOrder::kTiltCarriesPan}});
  head.read("latency", pan_tilt.latency, Range{-10, 10});
  head.done();
  return pan_tilt;
}

}  // namespace

FrameChain read_frame_chain(Section frames) {
  FrameChain chain;
  if (frames.has("base_from_camera") && frames.is_mapping_with("base_from_camera", "pan_tilt")) {
    Section base = frames.section("base_from_camera");
    chain.pan_tilt = read_pan_tilt(base.section("pan_tilt"));
    base.done();
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

Rigid3 head_turn(const HeadAxis& axis, double reading) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(axis.scale * reading + axis.zero, axis.direction));
  return {turn, axis.point - turn * axis.point};
}

Rigid3 base_from_camera(const FrameChain& chain, const std::optional<HeadAngles>& angles) {
  if (!chain.pan_tilt) return chain.base_from_camera;
  const HeadAngles a = angles.value_or(HeadAngles{});
  const Rigid3 pan = head_turn(chain.pan_tilt->pan, a.pan);
  const Rigid3 tilt = head_turn(chain.pan_tilt->tilt, a.tilt);
  const bool pan_first = chain.pan_tilt->order == HeadOrder::kPanCarriesTilt;
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(a.roll, Eigen::Vector3d::UnitZ()));
  return chain.pan_tilt->base_from_zero * (pan_first ? pan * tilt : tilt * pan) *
         Rigid3{roll, Eigen::Vector3d::Zero()};
}

std::optional<HeadAngles> head_angles_of(const FrameChain& chain,
                                         const Eigen::Quaterniond& body_from_camera) {
  if (!chain.pan_tilt || !body_from_camera.coeffs().allFinite()) return std::nullopt;
  // What a head that is stiff and level may be off; five metres away it is 17 cm.
  constexpr double kMostLeft = 2 * kRadFromDeg;
  const Eigen::Quaterniond body_from_base =
      chain.body_from_base ? chain.body_from_base->rotation : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond base_from_camera_seen = body_from_base.conjugate() * body_from_camera;
  // The angles of ideal axes to begin with: Ry(pan) Rx(tilt).
  const Eigen::Matrix3d R =
      (chain.pan_tilt->base_from_zero.rotation.conjugate() * base_from_camera_seen).toRotationMatrix();
  HeadAngles angles;
  angles.pan = std::atan2(-R(2, 0), R(0, 0));
  angles.tilt = std::atan2(-R(1, 2), R(1, 1));
  // Gauss-Newton on the rotation that is left, for axes as they were calibrated.
  const auto left_at = [&](const HeadAngles& a) {
    return so3_log(base_from_camera(chain, a).rotation.conjugate() * base_from_camera_seen);
  };
  constexpr double kStep = 1e-5;
  for (int pass = 0; pass < 5; ++pass) {
    const Eigen::Vector3d left = left_at(angles);
    HeadAngles panned = angles, tilted = angles;
    panned.pan += kStep, tilted.tilt += kStep;
    Eigen::Matrix<double, 3, 2> slope;
    slope << (left_at(panned) - left) / kStep, (left_at(tilted) - left) / kStep;
    const Eigen::Vector2d step = slope.colPivHouseholderQr().solve(-left);
    angles.pan += step.x(), angles.tilt += step.y();
  }
  if (!(left_at(angles).norm() < kMostLeft)) return std::nullopt;
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
