#pragma once

#include <span>
#include <stdexcept>
#include <vector>

#include "perch/flight/nav_track.h"
#include "perch/import/autopilot_log.h"
#include "perch/import/camera_turns.h"

namespace perch {

// When a camera that knows nothing of a log's clock saw what the log tells of: the offset at which both turn
// alike. The camera's mount need not be known.
//
//   1. The magnitudes of both angular velocities, which no mount changes, are correlated at every offset at
//      which at least half of the shorter of the two is covered: hills that may be it.
//   2. On each, offset, camera_from_body and the gyro's bias b are fitted to all three axes:
//          w_camera(t) = R (w_body(t - offset) + b) + e,   least squares, R by Kabsch
//      w_camera is a mean over the time between pictures at least 0.1 s apart, w_body over the same time, so
//      that neither's rate matters.
//   3. The best hill is taken, if the next best one explains the turns so much less that it is no rival.
//
// The deviation of the offset is that of least squares with errors that are correlated in time (Newey and
// West, Econometrica 55, 1987); of turns by tracks twice that, as these are off by more than chance.
struct TimeAlignment {
  int64_t offset_ns = 0;  // t_camera = t_log + offset
  double sigma = 0;       // s
  Eigen::Quaterniond camera_from_body = Eigen::Quaterniond::Identity();
  double explained = 0;        // of the square of the camera's angular velocity, 0 to 1
  double rival_explained = 0;  // by the next best offset
  double duration = 0;         // of the turns compared, s
  double by_target = 0;        // the part of them that the target told, 0 to 1
};

// It cannot be told; says why.
class AlignmentError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Both in the order of their times. Throws AlignmentError.
TimeAlignment align_times(std::span<const CameraTurn> turns, std::span<const GyroSample> gyro);

// For logs without a gyro: how the attitude turns from one sample to the next.
std::vector<GyroSample> angular_velocities(const NavTrack& nav);

}  // namespace perch
