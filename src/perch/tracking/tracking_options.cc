#include "perch/tracking/tracking_options.h"

namespace perch {

TrackingOptions read_tracking_options(Section tracking) {
  TrackingOptions o;
  tracking.read("acceleration_noise", o.acceleration_noise, kPositive);
  tracking.read("angular_acceleration_noise", o.angular_acceleration_noise, kPositive);
  tracking.read("pad_acceleration_noise", o.pad_acceleration_noise, kPositive);
  tracking.read("pad_angular_acceleration_noise", o.pad_angular_acceleration_noise, kPositive);
  tracking.read("gate", o.gate, kPositive);
  tracking.read("restart_after", o.restart_after, Range{1, 1000});
  tracking.read("coast", o.coast, kNotNegative);
  tracking.read("history", o.history, Range{0, 10});
  tracking.read("fuse_navigation", o.fuse_navigation);
  tracking.read("initial_velocity_sigma", o.initial_velocity_sigma, kPositive);
  tracking.read("initial_angular_velocity_sigma", o.initial_angular_velocity_sigma, kPositive);
  tracking.done();
  return o;
}

}  // namespace perch
