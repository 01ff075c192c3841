#include "perch/simulation/descent.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {

namespace {

constexpr double kGravity = 9.80665;  // m/s^2, down

// Which part of the way is still to go, and its derivatives by s = t / duration: a quintic with
// f(0) = 1, f'(0) = -kEntry, f''(0) = 0 and f(1) = f'(1) = f''(1) = 0.
constexpr double kEntry = 1.3;  // mean speeds at the start; above 2.5 it would pass below the pad
struct Way {
  double left = 0, rate = 0, acceleration = 0;
};
Way way_left(double s) {
  if (s <= 0) return {1 - kEntry * s, -kEntry, 0};
  if (s >= 1) return {};
  const double a = -10 + 6 * kEntry, b = 15 - 8 * kEntry, c = -6 + 3 * kEntry;
  return {1 - kEntry * s + s * s * s * (a + s * (b + s * c)),
          -kEntry + s * s * (3 * a + s * (4 * b + s * 5 * c)), s * (6 * a + s * (12 * b + s * 20 * c))};
}

// A place seen from the pad, NED.
Eigen::Vector3d beside(double bearing, double aside, double height) {
  return {aside * std::cos(bearing), aside * std::sin(bearing), -height};
}

// The axes of a body whose thrust gives this acceleration, with the nose towards a heading.
Eigen::Quaterniond attitude(const Eigen::Vector3d& acceleration, double heading) {
  const Eigen::Vector3d z = (Eigen::Vector3d(0, 0, kGravity) - acceleration).normalized();
  const Eigen::Vector3d right(-std::sin(heading), std::cos(heading), 0);
  const Eigen::Vector3d x = right.cross(z).normalized();  // leaning, but above the line of the heading
  Eigen::Matrix3d world_from_body;
  world_from_body << x, z.cross(x), z;
  return Eigen::Quaterniond(world_from_body);
}

}  // namespace

Descent::Descent(const DescentOptions& options, const Eigen::Vector3d& pad_in_world, uint64_t seed)
    : options_(options),
      start_(pad_in_world + beside(options.start_bearing, options.start_aside, options.start_height)),
      end_(pad_in_world + beside(options.start_bearing, options.touchdown_aside, options.touchdown_height)),
      random_(seed),
      position_gust_(options.gust_position, options.gust_correlation, random_),
      attitude_gust_(options.gust_attitude, options.gust_correlation, random_) {}

VehicleTruth Descent::at(double t) const {
  const double duration = options_.duration;
  const Way way = way_left(t / duration);
  const Eigen::Vector3d whole = start_ - end_;
  VehicleTruth truth;
  truth.world_from_body.translation = end_ + way.left * whole + position_gust_.value(t);
  truth.body_velocity_in_world = way.rate / duration * whole + position_gust_.rate(t);
  truth.body_acceleration_in_world =
      way.acceleration / (duration * duration) * whole + position_gust_.acceleration(t);
  const double heading = options_.start_bearing + M_PI + options_.yaw_drift * t;
  truth.world_from_body.rotation = positive_w(
      (attitude(truth.body_acceleration_in_world, heading) * so3_exp(attitude_gust_.value(t))).normalized());
  return truth;
}

}  // namespace perch
