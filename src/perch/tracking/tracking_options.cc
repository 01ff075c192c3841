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

std::vector<BodyNoise> body_hypotheses(const TrackingOptions& options) {
  // A ladder of even steps down to what tells the simulated descent in gusts best. Attitudes are held more
  // quietly than places: their steps are larger. With one step in place of two a descent that is neither
  // costs a third of the velocity's accuracy.
  constexpr BodyNoise kOfLively[] = {{1, 1}, {0.4, 0.2}, {0.15, 0.05}};
  std::vector<BodyNoise> bodies;
  for (const BodyNoise& part : kOfLively) {
    bodies.push_back({part.acceleration * options.acceleration_noise,
                      part.angular_acceleration * options.angular_acceleration_noise});
  }
  return bodies;
}

std::vector<PadNoise> pad_hypotheses(const TrackingOptions& options) {
  // Attitudes of an autopilot wander by half a degree in half a minute; its velocity drifts, as satellites
  // move: 0.2 m/s is much. Neither is the pad's doing, but nothing tells them apart.
  constexpr double kWander = 0.002;
  PadNoise moving;
  moving.acceleration = options.pad_acceleration_noise;
  moving.angular_acceleration = options.pad_angular_acceleration_noise;
  moving.wander = kWander;
  moving.velocity_sigma = 2;  // before the first measurement; ships at more are found too, some samples later
  moving.angular_velocity_sigma = 0.2;
  PadNoise standing;
  standing.acceleration = 0.01;
  standing.wander = kWander;
  standing.velocity_sigma = 0.2;
  standing.angular_velocity_sigma = 1e-4;
  return {moving, standing};
}

}  // namespace perch
