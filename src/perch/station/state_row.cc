#include "perch/station/state_row.h"

#include <bit>
#include <cmath>
#include <limits>

#include "perch/geometry/euler.h"

namespace perch {
namespace {

void put_pose(const Rigid3& pad_from_body, float* at) {
  const YawPitchRoll angles = ypr_from_rotation(pad_from_body.rotation);
  for (int i = 0; i < 3; ++i) at[i] = static_cast<float>(pad_from_body.translation[i]);
  at[3] = static_cast<float>(angles.yaw * kDegFromRad);
  at[4] = static_cast<float>(angles.pitch * kDegFromRad);
  at[5] = static_cast<float>(angles.roll * kDegFromRad);
}

// The deviations of yaw, pitch and roll, of a rotation vector's covariance: columns of the map from their
// rates to an angular velocity in the pad's axes, inverted. Near pitch = +-90 deg they are boundless.
Eigen::Vector3d angle_sigmas(const Rigid3& pad_from_body, const Eigen::Matrix3d& covariance) {
  const YawPitchRoll a = ypr_from_rotation(pad_from_body.rotation);
  Eigen::Matrix3d rotation_from_rates;
  rotation_from_rates << 0, -std::sin(a.yaw), std::cos(a.pitch) * std::cos(a.yaw),  //
      0, std::cos(a.yaw), std::cos(a.pitch) * std::sin(a.yaw),                      //
      1, 0, -std::sin(a.pitch);
  const Eigen::Matrix3d J = rotation_from_rates.inverse();
  return (J * covariance * J.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
}

void put_state(const VehicleState& state, StateRow& row) {
  row.source = static_cast<uint8_t>(static_cast<int>(state.source) + 1);
  put_pose(state.pad_from_body, &row.values[StateRow::kState]);
  const Eigen::Vector3d angles = angle_sigmas(state.pad_from_body, state.covariance.block<3, 3>(3, 3));
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<size_t>(i);
    row.values[StateRow::kSigma + k] = static_cast<float>(std::sqrt(state.covariance(i, i)));
    row.values[StateRow::kSigma + 3 + k] = static_cast<float>(angles[i] * kDegFromRad);
    row.values[StateRow::kVelocity + k] = static_cast<float>(state.body_velocity_in_pad[i]);
    row.values[StateRow::kVelocity + 3 + k] =
        static_cast<float>(state.body_angular_velocity_in_pad[i] * kDegFromRad);
  }
}

template <typename Unsigned>
void put(Unsigned value, std::vector<uint8_t>& bytes) {
  for (size_t i = 0; i < sizeof(value); ++i) bytes.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

}  // namespace

StateRow state_row(const Estimate& estimate, const Estimator::Aid& aid,
                   const std::optional<Rigid3>& navigation, std::optional<double> latency_ms) {
  StateRow row;
  row.timestamp_ns = estimate.timestamp_ns;
  row.status = static_cast<uint8_t>(estimate.status);
  row.values.fill(std::numeric_limits<float>::quiet_NaN());
  if (estimate.state && estimate.state->source != StateSource::kLost) {
    put_state(*estimate.state, row);
  } else if (estimate.state) {
    row.source = static_cast<uint8_t>(static_cast<int>(estimate.state->source) + 1);
  }
  if (navigation) put_pose(*navigation, &row.values[StateRow::kNavigation]);
  if (estimate.status == EstimateStatus::kOk) {
    const Rigid3& pose = estimate.camera_from_target.mean;
    const Eigen::Quaterniond q = positive_w(pose.rotation);
    const double camera[] = {
        pose.translation.x(), pose.translation.y(), pose.translation.z(), q.w(), q.x(), q.y(), q.z()};
    for (size_t i = 0; i < 7; ++i) row.values[StateRow::kCamera + i] = static_cast<float>(camera[i]);
    row.values[StateRow::kReprojection] = static_cast<float>(estimate.reprojection_rms_px);
    row.values[StateRow::kAmbiguity] = static_cast<float>(estimate.ambiguity);
  }
  row.values[StateRow::kFeatures] = static_cast<float>(estimate.features);
  row.values[StateRow::kEstimate] = static_cast<float>(1e-3 * estimate.total_us);
  if (latency_ms) row.values[StateRow::kLatency] = static_cast<float>(*latency_ms);
  if (aid.angles) {
    row.values[StateRow::kPan] = static_cast<float>(aid.angles->pan * kDegFromRad);
    row.values[StateRow::kTilt] = static_cast<float>(aid.angles->tilt * kDegFromRad);
  }
  if (aid.zoom) row.values[StateRow::kZoom] = static_cast<float>(*aid.zoom);
  return row;
}

void append_row(const StateRow& row, std::vector<uint8_t>& bytes) {
  put(row.sequence, bytes);
  bytes.push_back(row.status);
  bytes.push_back(row.source);
  put(uint16_t{0}, bytes);
  put(static_cast<uint64_t>(row.timestamp_ns), bytes);
  for (const float value : row.values) put(std::bit_cast<uint32_t>(value), bytes);
}

}  // namespace perch
