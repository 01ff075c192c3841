#pragma once

#include <optional>

#include "perch/config/section.h"
#include "perch/geometry/uncertainty.h"
#include "perch/tracking/vehicle_state.h"

namespace perch {

struct TrackingOptions {
  // White noise on acceleration: a small UAV's manoeuvres of 1 m/s^2 that last about a second.
  double acceleration_noise = 1.0;          // m/s^2/sqrt(Hz)
  double angular_acceleration_noise = 2.0;  // rad/s^2/sqrt(Hz)
  // Innovations above this chi-square (6 degrees of freedom) are not believed: one honest measurement in
  // 10,000.
  double gate = 27.9;
  // So many refused in a row, and it is the filter that is wrong: it starts anew from the last.
  int restart_after = 5;
  // Without a measurement the state is predicted for this long, then lost.
  double coast = 1.0;  // s
  // What is known of the motion when tracking starts.
  double initial_velocity_sigma = 3.0;          // m/s
  double initial_angular_velocity_sigma = 1.0;  // rad/s
};

// Reads the section and refuses unknown keys.
TrackingOptions read_tracking_options(Section tracking);

// The vehicle's pose and velocity in the pad frame: an error-state Kalman filter with constant velocity.
//
//   p' = p + v dt,  R' = Exp(w dt) R,  v and w random walks.   State error (d, r, dv, dw) as in VehicleState.
//
//            first measurement                      none for `coast` seconds
//   (none) --------------------> vision <--> predicted ------------------------> lost --measurement--> vision
class VehicleFilter {
 public:
  explicit VehicleFilter(const TrackingOptions& options) : options_(options) {}

  // The state at a frame's time, with the measurement of that frame where there is one. Empty before the
  // first measurement. Times must not go back: an earlier time than the last starts anew. A second
  // measurement of the same time changes nothing. One that is not finite, or whose covariance is none, counts
  // as no measurement.
  std::optional<VehicleState> update(int64_t timestamp_ns,
                                     const std::optional<UncertainRigid3>& pad_from_body);

  // Where the body will be, without changing anything; empty when not tracking.
  std::optional<VehicleState> predict(int64_t timestamp_ns) const;

 private:
  void start(int64_t timestamp_ns, const UncertainRigid3& pad_from_body);
  bool correct(const UncertainRigid3& pad_from_body);

  TrackingOptions options_;
  std::optional<VehicleState> state_;
  int64_t last_measured_ns_ = 0;
  int refused_ = 0;  // measurements in a row
};

}  // namespace perch
