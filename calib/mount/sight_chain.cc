#include "calib/mount/sight_chain.h"

#include <cmath>

#include "perch/flight/head_angles.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

int64_t ns(double s) { return std::llround(1e9 * s); }

// d of a product's (d, r) by its left factor's: d_c = d_a - [R_a p_b]x r_a, r_c = r_a.
Matrix6d by_left(const Rigid3& a, const Rigid3& b) {
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = -skew(a.rotation * b.translation);
  return J;
}

// By its right factor's: both turned by R_a.
Matrix6d by_right(const Rigid3& a) {
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = a.rotation.toRotationMatrix();
  return J;
}

// Of X = A^-1 P by A: d_X = R' (-d_A + [v]x r_A), r_X = -R' r_A with v = t_P - t_A.
Matrix6d by_inverse_left(const Rigid3& A, const Rigid3& P) {
  const Eigen::Matrix3d Rt = A.rotation.toRotationMatrix().transpose();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = -Rt;
  J.topRightCorner<3, 3>() = Rt * skew(P.translation - A.translation);
  return J;
}

void perpendiculars(const Eigen::Vector3d& axis, Eigen::Vector3d* e1, Eigen::Vector3d* e2) {
  *e1 = axis.unitOrthogonal();
  *e2 = axis.cross(*e1);
}

HeadAxis moved(const HeadAxis& nominal, const Eigen::Vector4d& by, double scale) {
  Eigen::Vector3d e1, e2;
  perpendiculars(nominal.direction, &e1, &e2);
  HeadAxis axis = nominal;
  axis.direction = so3_exp(e1 * by[0] + e2 * by[1]) * nominal.direction;
  axis.point = nominal.point + e1 * by[2] + e2 * by[3];
  axis.scale = nominal.scale * (1 + scale);
  return axis;
}

HeadAxis transformed(const Rigid3& b_from_a, HeadAxis axis) {
  axis.direction = b_from_a.rotation * axis.direction;
  axis.point = b_from_a * axis.point;
  return axis;
}

// The pose of a camera in its own zero frame: the head's two turns.
Rigid3 turned(const PanTilt& head, const HeadAngles& angles) {
  FrameChain chain;
  chain.pan_tilt = head;
  return base_from_camera(chain, angles);
}

std::optional<Rigid3> zero_from_camera(const MountChain& chain, const HeadVector& unknowns,
                                       const std::vector<GimbalSample>& gimbal, int64_t camera_ns) {
  if (!chain.head) return chain.base_from_camera;
  const PanTilt head = head_of(*chain.head, unknowns);
  const auto angles = head_angles_at(gimbal, camera_ns + ns(head.latency));
  if (!angles) return std::nullopt;
  return turned(head, *angles);
}

}  // namespace

MountChain mount_chain(const FrameChain& chain) {
  MountChain result{chain.base_from_camera, chain.pan_tilt, inverse(chain.target_from_pad)};
  if (!result.head) return result;
  PanTilt& head = *result.head;
  head.base_from_zero = {};
  // Turn(first) Turn(second) at readings plus zeros: with h the second one's turn at reading 0,
  // E1(a + z1) E2(b + z2) = E1(z1) h [h^-1 E1(a) h] E2(b), the axes moved by h^-1.
  HeadAxis& first = head.order == HeadOrder::kPanCarriesTilt ? head.pan : head.tilt;
  HeadAxis& second = head.order == HeadOrder::kPanCarriesTilt ? head.tilt : head.pan;
  const Rigid3 h = head_turn(second, 0);
  first = transformed(inverse(h), first);
  first.zero = second.zero = 0;
  return result;
}

Rigid3 nominal_mount(const FrameChain& chain) {
  const Rigid3 mount = chain.body_from_base.value_or(Rigid3{});
  return chain.pan_tilt ? mount * base_from_camera(chain, HeadAngles{}) : mount;
}

PanTilt head_of(const PanTilt& nominal, const HeadVector& x) {
  PanTilt head = nominal;
  head.pan = moved(nominal.pan, x.segment<4>(0), x[8]);
  head.tilt = moved(nominal.tilt, x.segment<4>(4), x[9]);
  head.latency = nominal.latency + x[10];
  return head;
}

std::optional<Rigid3> body_from_camera(const MountChain& chain, const Rigid3& mount, const HeadVector& head,
                                       const std::vector<GimbalSample>& gimbal, int64_t camera_ns) {
  const auto turn = zero_from_camera(chain, head, gimbal, camera_ns);
  if (!turn) return std::nullopt;
  return mount * *turn;
}

std::optional<SightPrediction> predict_sight(const SightInputs& in, const Rigid3& mount, const Rigid3& pad,
                                             double offset, const HeadVector& head,
                                             const Vector6d& correction) {
  const auto nav = in.trajectory.at(in.camera_ns - ns(offset));
  if (!nav) return std::nullopt;
  const auto turn = zero_from_camera(in.chain, head, in.gimbal, in.camera_ns);
  if (!turn) return std::nullopt;
  const Rigid3 W = perturb(nav->world_from_body, correction);
  const Rigid3 C = mount * *turn, A = W * C, P = pad * in.chain.pad_from_target;

  SightPrediction s;
  s.camera_from_target = inverse(A) * P;
  s.world_from_body = nav->world_from_body;
  s.noise_part = nav->noise_part;
  const Matrix6d by_A = by_inverse_left(A, P);
  const Matrix6d by_W = by_A * by_left(W, C), by_C = by_A * by_right(W);
  s.by_mount = by_C * by_left(mount, *turn);
  s.by_pad = by_right(inverse(A)) * by_left(pad, in.chain.pad_from_target);
  const Eigen::Vector3d r = correction.tail<3>();
  Matrix6d left = Matrix6d::Identity();
  left.bottomRightCorner<3, 3>() = so3_left_jacobian(r);
  s.by_correction = by_W * left;
  Vector6d rate;  // of W by navigation time
  rate << nav->velocity, so3_exp(r) * nav->turn_rate;
  s.by_offset = -by_W * rate;
  s.by_head.setZero();
  if (in.chain.head) {
    // Central differences: exact to 1e-10 for steps of 1e-5 rad or m; of 1 ms for the latency, which is
    // interpolated between readings.
    for (int i = 0; i < kHeadSize; ++i) {
      const double step = i == kHeadSize - 1 ? 1e-3 : 1e-5;
      HeadVector plus = head, minus = head;
      plus[i] += step;
      minus[i] -= step;
      const auto a = zero_from_camera(in.chain, minus, in.gimbal, in.camera_ns);
      const auto b = zero_from_camera(in.chain, plus, in.gimbal, in.camera_ns);
      if (!a || !b) return std::nullopt;
      s.by_head.col(i) = by_C * by_right(mount) * pose_error(*a, *b) / (2 * step);
    }
  }
  return s;
}

}  // namespace perch
