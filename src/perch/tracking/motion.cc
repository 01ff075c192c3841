#include "perch/tracking/motion.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Where the parts of the error state are.
constexpr Eigen::Index kD = 0, kR = 3, kDv = 6, kDw = 9, kQ = 12, kDc = 15, kDW = 18;

// Both halves of what rounding has made of them: over thousands of steps they would drift apart.
void make_symmetric(Motion::Covariance& P) { P = (0.5 * (P + P.transpose())).eval(); }

// Each velocity-like part has its position-like one, but for the pad's place in the world, which nobody asks
// for.
struct Driven {
  Eigen::Index velocity, position;
};
constexpr Driven kDriven[] = {{kDv, kD}, {kDw, kR}, {kDW, kQ}, {kDc, -1}};

// White acceleration of covariance density S between two parts over dt.
void add_driven(Motion::Covariance& P, const Driven& a, const Driven& b, const Matrix3d& S, double dt) {
  const auto add = [&](Eigen::Index row, Eigen::Index column, double factor) {
    if (row >= 0 && column >= 0) P.block<3, 3>(row, column) += factor * S;
  };
  add(a.velocity, b.velocity, dt);
  add(a.position, b.velocity, dt * dt / 2);
  add(a.velocity, b.position, dt * dt / 2);
  add(a.position, b.position, dt * dt * dt / 3);
}

Innovation three(const Motion& motion, const Vector3d& y, double sigma) {
  Innovation innovation;
  innovation.y = y;
  innovation.H.setZero(3, motion.P.rows());
  innovation.R = sigma * sigma * Matrix3d::Identity();
  return innovation;
}

}  // namespace

Motion::Motion(const UncertainRigid3& measured, double velocity_sigma, double angular_velocity_sigma)
    : pad_from_body(measured.mean), P(Covariance::Zero(kOfPad, kOfPad)) {
  P.topLeftCorner<6, 6>() = measured.covariance;
  P.diagonal().segment<3>(kDv).setConstant(velocity_sigma * velocity_sigma);
  P.diagonal().segment<3>(kDw).setConstant(angular_velocity_sigma * angular_velocity_sigma);
}

Motion::Covariance Motion::transition(double dt) const {
  Covariance F = Covariance::Identity(P.rows(), P.rows());
  const Matrix3d I = Matrix3d::Identity();
  F.block<3, 3>(kD, kDv) = I * dt;
  // Exp(r') = Exp((w + dw) dt) Exp(r) Exp(-w dt).
  const Vector3d turned = angular_velocity * dt;
  F.block<3, 3>(kR, kR) = so3_exp(turned).toRotationMatrix();
  F.block<3, 3>(kR, kDw) = so3_left_jacobian(turned) * dt;
  if (!knows_world()) return F;
  const Vector3d& p = pad_from_body.translation;
  const Vector3d& W = pad_angular_velocity;
  F.block<3, 3>(kDv, kD) = -skew(W) * skew(W) * dt;
  F.block<3, 3>(kDv, kDv) = I - 2 * skew(W) * dt;
  F.block<3, 3>(kDv, kDW) =
      (2 * skew(velocity) - W.dot(p) * I - W * p.transpose() + 2 * p * W.transpose()) * dt;
  // Exp(q') = Exp(-W dt) Exp(q) Exp((W + dW) dt).
  const Vector3d pad_turned = W * dt;
  const Matrix3d back = so3_exp(-pad_turned).toRotationMatrix();
  F.block<3, 3>(kQ, kQ) = back;
  F.block<3, 3>(kQ, kDW) = so3_left_jacobian(-pad_turned) * dt;
  F.block<3, 3>(kDc, kDc) = back;
  F.block<3, 3>(kDc, kDW) = skew(pad_velocity) * dt;
  return F;
}

// What pushes the pad pushes the body the other way, as seen from the pad.
void Motion::add_noise(double dt, const BodyNoise& body, const PadNoise& pad) {
  const Matrix3d I = Matrix3d::Identity();
  const Matrix3d push = I * body.acceleration * body.acceleration;
  const Matrix3d turn = I * body.angular_acceleration * body.angular_acceleration;
  const auto& [v, w, W, c] = kDriven;
  if (!knows_world()) {
    add_driven(P, v, v, push, dt);
    add_driven(P, w, w, turn, dt);
    return;
  }
  const Matrix3d pad_push = I * pad.acceleration * pad.acceleration;
  const Matrix3d pad_turn = I * pad.angular_acceleration * pad.angular_acceleration;
  const Matrix3d arm = skew(pad_from_body.translation);
  const auto add_both = [&](const Driven& a, const Driven& b, const Matrix3d& S) {
    add_driven(P, a, b, S, dt);
    add_driven(P, b, a, S.transpose(), dt);
  };
  add_driven(P, v, v, push + pad_push + arm * pad_turn * arm.transpose(), dt);
  add_driven(P, w, w, turn + pad_turn, dt);
  add_driven(P, W, W, pad_turn, dt);
  add_driven(P, c, c, pad_push, dt);
  add_both(v, c, -pad_push);
  add_both(v, W, arm * pad_turn);
  add_both(v, w, -arm * pad_turn);
  add_both(w, W, -pad_turn);
  P.block<3, 3>(kQ, kQ) += I * (pad.wander * pad.wander * dt);
}

void Motion::propagate(double dt, const BodyNoise& body, const PadNoise& pad) {
  if (dt <= 0) return;
  const Covariance F = transition(dt);
  P = (F * P * F.transpose()).eval();
  add_noise(dt, body, pad);
  make_symmetric(P);
  const Vector3d& W = pad_angular_velocity;
  Vector3d& p = pad_from_body.translation;
  const Vector3d v = velocity;
  if (knows_world()) velocity -= (2 * W.cross(v) + W.cross(W.cross(p))) * dt;
  p += v * dt;
  pad_from_body.rotation = (so3_exp(angular_velocity * dt) * pad_from_body.rotation).normalized();
  if (!knows_world()) return;
  world_from_pad = (world_from_pad * so3_exp(W * dt)).normalized();
  pad_velocity = so3_exp(-W * dt) * pad_velocity;
}

// Q = A R^T of the attitude A = Exp(e) Q R: q = -r - Q^T e, fully correlated with r.
void Motion::meet_world(const Eigen::Quaterniond& world_from_body, double attitude_sigma,
                        const PadNoise& pad) {
  forget_world();
  world_from_pad = (world_from_body * pad_from_body.rotation.conjugate()).normalized();
  Covariance all = Covariance::Zero(21, 21);
  all.topLeftCorner<kOfPad, kOfPad>() = P;
  all.block<3, kOfPad>(kQ, 0) = -P.middleRows<3>(kR);
  all.block<kOfPad, 3>(0, kQ) = -P.middleCols<3>(kR);
  all.block<3, 3>(kQ, kQ) = P.block<3, 3>(kR, kR) + attitude_sigma * attitude_sigma * Matrix3d::Identity();
  all.diagonal().segment<3>(kDc).setConstant(pad.velocity_sigma * pad.velocity_sigma);
  all.diagonal().segment<3>(kDW).setConstant(pad.angular_velocity_sigma * pad.angular_velocity_sigma);
  P = all;
}

void Motion::forget_world() {
  world_from_pad.setIdentity();
  pad_velocity.setZero();
  pad_angular_velocity.setZero();
  P = P.topLeftCorner<kOfPad, kOfPad>().eval();
}

Innovation Motion::of_pose(const UncertainRigid3& measured) const {
  Innovation innovation;
  innovation.y = pose_error(pad_from_body, measured.mean);
  innovation.H.setZero(6, P.rows());
  innovation.H.leftCols<6>().setIdentity();
  innovation.R = measured.covariance;
  return innovation;
}

// Q Exp(q) Exp(r) R: q + r.
Innovation Motion::of_attitude(const Eigen::Quaterniond& world_from_body, double sigma) const {
  const Eigen::Quaterniond error =
      world_from_pad.conjugate() * world_from_body * pad_from_body.rotation.conjugate();
  Innovation innovation = three(*this, so3_log(error), sigma);
  innovation.H.block<3, 3>(0, kR).setIdentity();
  innovation.H.block<3, 3>(0, kQ).setIdentity();
  return innovation;
}

// Q^T V = Exp(q) (c + v + W x p).
Innovation Motion::of_velocity(const Vector3d& body_velocity_in_world, double sigma) const {
  const Vector3d& p = pad_from_body.translation;
  const Vector3d expected = pad_velocity + velocity + pad_angular_velocity.cross(p);
  Innovation innovation = three(*this, world_from_pad.conjugate() * body_velocity_in_world - expected, sigma);
  innovation.H.block<3, 3>(0, kD) = skew(pad_angular_velocity);
  innovation.H.block<3, 3>(0, kDv).setIdentity();
  innovation.H.block<3, 3>(0, kQ) = -skew(expected);
  innovation.H.block<3, 3>(0, kDc).setIdentity();
  innovation.H.block<3, 3>(0, kDW) = -skew(p);
  return innovation;
}

// R g = Exp(-r) (w + W).
Innovation Motion::of_angular_velocity(const Vector3d& angular_velocity_in_body, double sigma) const {
  const Vector3d expected = angular_velocity + pad_angular_velocity;
  Innovation innovation = three(*this, pad_from_body.rotation * angular_velocity_in_body - expected, sigma);
  innovation.H.block<3, 3>(0, kR) = skew(expected);
  innovation.H.block<3, 3>(0, kDw).setIdentity();
  innovation.H.block<3, 3>(0, kDW).setIdentity();
  return innovation;
}

Motion::Surprise Motion::surprise(const Innovation& innovation) const {
  const auto& [y, H, R] = innovation;
  const Innovation::Noise S = H * P * H.transpose() + R;
  const Eigen::LLT<Innovation::Noise> llt(S);
  const double squared = llt.info() == Eigen::Success ? y.dot(llt.solve(y)) : NAN;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!std::isfinite(squared)) return {kInfinity, -kInfinity};
  return {squared, -squared / 2 - llt.matrixLLT().diagonal().array().log().sum()};
}

void Motion::correct(const Innovation& innovation) {
  const auto& [y, H, R] = innovation;
  using Wide = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 21, 6>;
  using Step = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 21, 1>;
  const Innovation::Jacobian HP = H * P;
  const Eigen::LLT<Innovation::Noise> llt(Innovation::Noise(HP * H.transpose() + R));
  const Wide K = llt.solve(HP).transpose();
  const Step step = K * y;
  pad_from_body = perturb(pad_from_body, step.head<6>());
  velocity += step.segment<3>(kDv);
  angular_velocity += step.segment<3>(kDw);
  if (knows_world()) {
    world_from_pad = (world_from_pad * so3_exp(step.segment<3>(kQ))).normalized();
    pad_velocity += step.segment<3>(kDc);
    pad_angular_velocity += step.segment<3>(kDW);
  }
  // Joseph's form, (I - K H) P (I - K H)^T + K R K^T: stays positive whatever the rounding.
  const Covariance once = P - K * HP;
  const Wide once_H = once * H.transpose();
  P = once - once_H * K.transpose() + K * R * K.transpose();
  make_symmetric(P);
}

}  // namespace perch
