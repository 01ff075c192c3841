#pragma once

#include <vector>

#include "perch/config/section.h"
#include "perch/tracking/motion.h"

namespace perch {

struct TrackingOptions {
  // White noise on the acceleration of a lively body: manoeuvres of 1 m/s^2 that last about a second. Calmer
  // ones are tried beside it, and each speaks by its probability: body_hypotheses.
  double acceleration_noise = 1.0;          // m/s^2/sqrt(Hz)
  double angular_acceleration_noise = 2.0;  // rad/s^2/sqrt(Hz)
  // Of a pad that moves, tried beside one that stands still. On the simulated deck in sea state 4 these leave
  // NEES below its mean; twice as much costs a third of the velocity's accuracy there.
  double pad_acceleration_noise = 0.25;
  double pad_angular_acceleration_noise = 0.025;
  // Innovations above this chi-square (6 degrees of freedom) are not believed: one honest measurement in
  // 10,000.
  double gate = 27.9;
  // So many refused in a row, and it is the filter that is wrong: it starts anew from the last.
  int restart_after = 5;
  // Without a measured pose the state is predicted for this long, then lost.
  double coast = 1.0;  // s
  // Measurements that come late are taken at their own time when it is no longer ago than this.
  double history = 0.5;  // s
  // perch-batch only: what the flight's navigation says of attitude and velocity is fused too, as a live run
  // does. Not by default: a score against that same navigation would then be one of itself in part.
  bool fuse_navigation = false;
  // What is known of the motion when tracking starts.
  double initial_velocity_sigma = 3.0;          // m/s
  double initial_angular_velocity_sigma = 1.0;  // rad/s
};

// Reads the section and refuses unknown keys.
TrackingOptions read_tracking_options(Section tracking);

// What a MotionBank tries: a lively body and calmer ones, a pad that moves and one that stands. The first of
// each is the one that allows for more.
std::vector<BodyNoise> body_hypotheses(const TrackingOptions& options);
std::vector<PadNoise> pad_hypotheses(const TrackingOptions& options);

}  // namespace perch
