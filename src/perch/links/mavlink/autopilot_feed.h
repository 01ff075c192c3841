#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "perch/frames/frame_chain.h"
#include "perch/links/mavlink/vehicle_history.h"
#include "perch/tracking/autopilot_sample.h"

namespace perch::mavlink {

// What the autopilot said, as the estimator takes it: what is new since the frame before, for the filter, and
// the attitude at the frame's own time. `time_offset` is the camera's clock minus ours, s: what a calibration
// found between two clocks that are matched already (frames.time_offset).
class AutopilotFeed {
 public:
  explicit AutopilotFeed(double time_offset = 0);

  // Each sample once, in the order of their times, on the camera's clock. Of a stream quicker than
  // kMostSamplesHz not every one: neighbours tell the filter the same, and each costs it time.
  std::vector<AutopilotSample> take(const VehicleHistory& history);

  std::optional<Eigen::Quaterniond> attitude_at(const VehicleHistory& history, int64_t camera_time_ns) const;

  // How a pan/tilt head holds the camera, as a gimbal and the autopilot tell.
  std::optional<HeadAngles> head_angles_at(const VehicleHistory& history, const FrameChain& chain,
                                           int64_t camera_time_ns) const;

  static constexpr double kMostSamplesHz = 60;

 private:
  int64_t time_offset_ns_;
  int64_t last_attitude_ns_, last_motion_ns_;
};

}  // namespace perch::mavlink
