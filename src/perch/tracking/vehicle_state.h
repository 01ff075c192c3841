#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "perch/geometry/rigid3.h"

namespace perch {

enum class StateSource { kVision, kPredicted, kLost };

// Where the vehicle is and how it moves relative to the pad, at one moment.
struct VehicleState {
  int64_t timestamp_ns = 0;  // camera clock
  Rigid3 pad_from_body;
  Eigen::Vector3d body_velocity_in_pad = Eigen::Vector3d::Zero();          // m/s
  Eigen::Vector3d body_angular_velocity_in_pad = Eigen::Vector3d::Zero();  // rad/s
  // Of (d, r, dv, dw), the pose part as in geometry/uncertainty.h.
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  StateSource source = StateSource::kLost;
  // The normalised innovation squared of the pose measured at this moment (6 degrees of freedom), believed or
  // not; empty without one, and where tracking began with it.
  std::optional<double> innovation_squared;
};

}  // namespace perch
