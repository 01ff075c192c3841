#include "perch/analysis/frame_record.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/euler.h"

namespace perch {

SixStates six_states(const Rigid3& pad_from_body) {
  const YawPitchRoll angles = ypr_from_rotation(pad_from_body.rotation);
  SixStates states;
  states << pad_from_body.translation, angles.yaw, angles.pitch, angles.roll;
  return states;
}

SixStates six_sigmas(const UncertainRigid3& pad_from_body) {
  // The rotation vector of a small change, in pad axes, is each angle's change about its own axis:
  //   r = e_z dyaw + Rz e_y dpitch + Rz Ry e_x droll.
  const YawPitchRoll angles = ypr_from_rotation(pad_from_body.mean.rotation);
  const double cy = std::cos(angles.yaw), sy = std::sin(angles.yaw);
  const double cp = std::cos(angles.pitch), sp = std::sin(angles.pitch);
  Eigen::Matrix3d r_from_angles;
  r_from_angles << 0, -sy, cy * cp,  //
      0, cy, sy * cp,                //
      1, 0, -sp;
  const Eigen::Matrix3d angles_from_r = r_from_angles.inverse();
  const Eigen::Matrix3d rotation = pad_from_body.covariance.bottomRightCorner<3, 3>();
  SixStates sigmas;
  sigmas << pad_from_body.covariance.diagonal().head<3>(),
      (angles_from_r * rotation * angles_from_r.transpose()).diagonal();
  return sigmas.cwiseSqrt();
}

FrameError frame_error(const Estimate& estimate, const FrameChain& chain, const Rigid3& reference) {
  const Rigid3& vision = estimate.pad_from_body->mean;
  FrameError error;
  error.difference = six_states(vision) - six_states(reference);
  for (int i = 3; i < 6; ++i) error.difference[i] = wrap_angle(error.difference[i]);
  error.position = error.difference.head<3>().norm();
  error.rotation = vision.rotation.angularDistance(reference.rotation);

  // NEES where the camera measures. In the pad frame a tilt swings the body about the pad on an arc that no
  // covariance follows: ten degrees at 9 m are 14 cm along z, whose sigma is 1 cm, and the paper's method had
  // 13.9 on a flight where it is 6.6.
  const UncertainRigid3& seen = estimate.camera_from_target;
  const Rigid3 camera_from_target =
      seen.mean * chain.target_from_pad * vision * inverse(reference) * inverse(chain.target_from_pad);
  error.seen_position = (seen.mean.translation - camera_from_target.translation).norm();
  const double nees = normalised_error_squared(pose_error(seen.mean, camera_from_target), seen.covariance);
  if (std::isfinite(nees)) error.nees = nees;
  return error;
}

FrameRecord make_frame_record(const Estimate& estimate, const FrameChain& chain, const Flight& flight) {
  FrameRecord record;
  record.timestamp_ns = estimate.timestamp_ns;
  record.status = estimate.status;
  record.total_us = estimate.total_us;
  record.ambiguity = estimate.ambiguity;
  record.threshold = estimate.threshold;
  if (estimate.state) record.nis = estimate.state->innovation_squared;

  std::optional<Rigid3> navigation;
  if (const auto sample = flight.nav.at(navigation_time_ns(chain, estimate.timestamp_ns))) {
    navigation = pad_from_body_by_navigation(chain, sample->world_from_body);
    record.speed = sample->body_velocity_in_world.norm();
  }
  if (navigation) record.navigation = six_states(*navigation);

  if (estimate.status != EstimateStatus::kOk || !estimate.pad_from_body) return record;
  const UncertainRigid3& vision = *estimate.pad_from_body;
  const SixStates states = six_states(vision.mean);
  if (!states.allFinite()) return record;  // one NaN would make every statistic NaN
  const Eigen::Vector3d camera_in_target = inverse(estimate.camera_from_target.mean).translation;
  record.range = camera_in_target.norm();
  if (record.range > 0)
    record.view_angle = std::acos(std::clamp(camera_in_target.z() / record.range, -1.0, 1.0));
  record.reprojection_rms_px = estimate.reprojection_rms_px;
  record.features = estimate.features;
  record.vision = states;
  record.sigma = six_sigmas(vision);
  if (navigation) record.error = frame_error(estimate, chain, *navigation);
  if (const auto sample = flight.truth.at(estimate.timestamp_ns)) {
    const auto truth = pad_from_body_by_navigation(chain, sample->world_from_body);
    if (truth) record.truth_error = frame_error(estimate, chain, *truth);
  }
  return record;
}

}  // namespace perch
