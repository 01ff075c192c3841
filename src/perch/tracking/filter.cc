#include "perch/tracking/filter.h"

#include <Eigen/Cholesky>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

using Matrix12d = Eigen::Matrix<double, 12, 12>;

// Of times in order. Unsigned: the difference of two times from a broken file may be too large for int64_t.
double seconds(int64_t from_ns, int64_t to_ns) {
  return static_cast<double>(static_cast<uint64_t>(to_ns) - static_cast<uint64_t>(from_ns)) * 1e-9;
}

// Finite, and a covariance that is one. Anything else would stay in the state for ever.
bool is_usable(const UncertainRigid3& pose) {
  return pose.mean.translation.allFinite() && pose.mean.rotation.coeffs().allFinite() &&
         pose.covariance.allFinite() && Eigen::LDLT<PoseCovariance>(pose.covariance).isPositive();
}

// Both halves of what rounding has made of them: over thousands of steps they would drift apart.
void make_symmetric(Matrix12d& P) { P = (0.5 * (P + P.transpose())).eval(); }

// White acceleration of density q^2 over dt, on a position-like (row 0) and a velocity-like (row 6) state.
void add_noise(Matrix12d& P, Eigen::Index at, double q, double dt) {
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity() * q * q;
  P.block<3, 3>(at, at) += I * (dt * dt * dt / 3);
  P.block<3, 3>(at, at + 6) += I * (dt * dt / 2);
  P.block<3, 3>(at + 6, at) += I * (dt * dt / 2);
  P.block<3, 3>(at + 6, at + 6) += I * dt;
}

VehicleState propagate(const VehicleState& state, int64_t timestamp_ns, const TrackingOptions& options) {
  const double dt = seconds(state.timestamp_ns, timestamp_ns);
  VehicleState next = state;
  next.timestamp_ns = timestamp_ns;
  const Eigen::Vector3d turned = state.body_angular_velocity_in_pad * dt;
  const Eigen::Quaterniond turn = so3_exp(turned);
  next.pad_from_body.translation += state.body_velocity_in_pad * dt;
  next.pad_from_body.rotation = (turn * state.pad_from_body.rotation).normalized();
  // Exp(r') = Exp((w + dw) dt) Exp(r) Exp(-w dt).
  Matrix12d F = Matrix12d::Identity();
  F.block<3, 3>(0, 6) = Eigen::Matrix3d::Identity() * dt;
  F.block<3, 3>(3, 3) = turn.toRotationMatrix();
  F.block<3, 3>(3, 9) = so3_left_jacobian(turned) * dt;
  next.covariance = F * state.covariance * F.transpose();
  add_noise(next.covariance, 0, options.acceleration_noise, dt);
  add_noise(next.covariance, 3, options.angular_acceleration_noise, dt);
  make_symmetric(next.covariance);
  return next;
}

}  // namespace

TrackingOptions read_tracking_options(Section tracking) {
  TrackingOptions o;
  tracking.read("acceleration_noise", o.acceleration_noise, kPositive);
  tracking.read("angular_acceleration_noise", o.angular_acceleration_noise, kPositive);
  tracking.read("gate", o.gate, kPositive);
  tracking.read("restart_after", o.restart_after, Range{1, 1000});
  tracking.read("coast", o.coast, kNotNegative);
  tracking.read("initial_velocity_sigma", o.initial_velocity_sigma, kPositive);
  tracking.read("initial_angular_velocity_sigma", o.initial_angular_velocity_sigma, kPositive);
  tracking.done();
  return o;
}

void VehicleFilter::start(int64_t timestamp_ns, const UncertainRigid3& pad_from_body) {
  VehicleState state;
  state.timestamp_ns = timestamp_ns;
  state.pad_from_body = pad_from_body.mean;
  state.covariance.topLeftCorner<6, 6>() = pad_from_body.covariance;
  const double v = options_.initial_velocity_sigma, w = options_.initial_angular_velocity_sigma;
  state.covariance.diagonal().segment<3>(6).setConstant(v * v);
  state.covariance.diagonal().segment<3>(9).setConstant(w * w);
  state.source = StateSource::kVision;
  state_ = state;
  last_measured_ns_ = timestamp_ns;
  refused_ = 0;
}

bool VehicleFilter::correct(const UncertainRigid3& pad_from_body) {
  const PoseError innovation = pose_error(state_->pad_from_body, pad_from_body.mean);
  Matrix12d& P = state_->covariance;
  const PoseCovariance S = P.topLeftCorner<6, 6>() + pad_from_body.covariance;
  const Eigen::LLT<PoseCovariance> llt(S);
  // A NaN fails both.
  if (llt.info() != Eigen::Success || !(innovation.dot(llt.solve(innovation)) <= options_.gate)) return false;
  const Eigen::Matrix<double, 12, 6> K = llt.solve(P.topRows<6>()).transpose();
  const Eigen::Matrix<double, 12, 1> step = K * innovation;
  state_->pad_from_body = perturb(state_->pad_from_body, step.head<6>());
  state_->body_velocity_in_pad += step.segment<3>(6);
  state_->body_angular_velocity_in_pad += step.tail<3>();
  // Joseph's form: stays positive whatever the rounding.
  Matrix12d A = Matrix12d::Identity();
  A.leftCols<6>() -= K;
  P = (A * P * A.transpose() + K * pad_from_body.covariance * K.transpose()).eval();
  make_symmetric(P);
  return true;
}

std::optional<VehicleState> VehicleFilter::predict(int64_t timestamp_ns) const {
  if (!state_ || state_->source == StateSource::kLost || timestamp_ns < state_->timestamp_ns ||
      seconds(last_measured_ns_, timestamp_ns) > options_.coast) {
    return std::nullopt;
  }
  VehicleState next = propagate(*state_, timestamp_ns, options_);
  next.source = StateSource::kPredicted;
  return next;
}

std::optional<VehicleState> VehicleFilter::update(int64_t timestamp_ns,
                                                  const std::optional<UncertainRigid3>& pad_from_body) {
  // The same frame twice: counted again, its noise would seem to average out.
  if (state_ && state_->source == StateSource::kVision && state_->timestamp_ns == timestamp_ns) return state_;
  const bool measured = pad_from_body && is_usable(*pad_from_body);
  const auto predicted = predict(timestamp_ns);
  if (!predicted) {
    // Not yet tracking, lost, or a clock that went back.
    if (measured) {
      start(timestamp_ns, *pad_from_body);
    } else if (state_) {
      state_->timestamp_ns = timestamp_ns;
      state_->source = StateSource::kLost;
    }
    return state_;
  }
  state_ = predicted;
  if (!measured) return state_;
  if (correct(*pad_from_body)) {
    state_->source = StateSource::kVision;
    last_measured_ns_ = timestamp_ns;
    refused_ = 0;
  } else if (++refused_ >= options_.restart_after) {
    start(timestamp_ns, *pad_from_body);
  }
  return state_;
}

}  // namespace perch
