#pragma once

#include "calib/mount/mount_types.h"
#include "calib/mount/trajectory.h"

namespace perch {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// What is known of the chain besides the unknowns.
struct MountChain {
  Rigid3 base_from_camera;      // of a fixed camera
  std::optional<PanTilt> head;  // the nominal one, its zeros 0 and base_from_zero the identity
  Rigid3 pad_from_target;
};

// A frame chain as the calibration takes it, and the mount it starts from. A head's zeros and base_from_zero
// go into the mount: what turns the camera at reading 0 cannot be told from how the head is bolted on.
MountChain mount_chain(const FrameChain& chain);
Rigid3 nominal_mount(const FrameChain& chain);

// The head with the unknowns applied to its nominal axes: directions turned about two perpendiculars, points
// moved along them, scales multiplied by 1 + x, the latency added to.
PanTilt head_of(const PanTilt& nominal, const HeadVector& unknowns);

// body_from_camera at a moment of the camera's clock; empty where the head's readings have a gap.
std::optional<Rigid3> body_from_camera(const MountChain& chain, const Rigid3& mount, const HeadVector& head,
                                       const std::vector<GimbalSample>& gimbal, int64_t camera_ns);

// Where the target should be seen, and how that depends on everything. All by (d, r) on the left, as
// PoseCovariance has it; `correction` is the navigation's error as a PoseError: truth = perturb(navigation,
// correction).
struct SightPrediction {
  Rigid3 camera_from_target;
  Rigid3 world_from_body;  // of navigation, uncorrected
  Matrix6d by_mount, by_pad, by_correction;
  Vector6d by_offset;
  Eigen::Matrix<double, 6, kHeadSize> by_head;
  Vector6d noise_part = Vector6d::Ones();  // TrajectoryPoint's
};

struct SightInputs {
  const MountChain& chain;
  const Trajectory& trajectory;
  const std::vector<GimbalSample>& gimbal;
  int64_t camera_ns;
};

// Empty where navigation or the head have a gap. The chain:
//   world_from_camera = correction . navigation(t - offset) * mount * head(t + latency)
//   camera_from_target = world_from_camera^-1 * world_from_pad * pad_from_target
std::optional<SightPrediction> predict_sight(const SightInputs& inputs, const Rigid3& mount,
                                             const Rigid3& pad, double offset, const HeadVector& head,
                                             const Vector6d& correction = Vector6d::Zero());

}  // namespace perch
