#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "perch/geometry/uncertainty.h"
#include "perch/tracking/autopilot_sample.h"

namespace perch {

// Densities of the white noise that drives a body.
struct BodyNoise {
  double acceleration = 0;          // m/s^2/sqrt(Hz)
  double angular_acceleration = 0;  // rad/s^2/sqrt(Hz)
};

// And a pad in the autopilot's world.
struct PadNoise {
  double acceleration = 0;
  double angular_acceleration = 0;
  double wander = 0;  // of the autopilot's attitude against the world it means, rad/sqrt(s)
  // What is known of the pad's motion before anything was heard.
  double velocity_sigma = 0;          // m/s
  double angular_velocity_sigma = 0;  // rad/s
};

// What a measurement adds: y = H x + noise of covariance R, for the error state x of a Motion.
struct Innovation {
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;
  using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 21>;
  using Noise = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
  Vector y;
  Jacobian H;
  Noise R;
};

// How a body moves relative to a pad, and, once an autopilot was heard, how the pad moves in the autopilot's
// world. The pad may lie turned in that world, and it may be a ship's deck. All in the axes of the pad:
//
//   p' = v                               place of the body
//   R' = [w]x R                          pad_from_body
//   v' = -2 W x v - W x (W x p) + noise  velocity of the body as seen from the pad
//   w' = noise                           angular velocity, likewise
//   Q' = Q [W]x                          world_from_pad
//   c' = -W x c + noise                  velocity of the pad's origin in the world (with what the autopilot's
//                                        own velocity is off)
//   W' = noise                           angular velocity of the pad in the world
//
// What the autopilot says is then
//
//   attitude Q R,   velocity Q (c + v + W x p),   angular velocity R^T (w + W).
//
// Vision sees (p, R) alone, so that nothing of the world is assumed: Q, c and W are what makes both agree.
// Error state: (d, r, dv, dw | q, dc, dW), truth = (p + d, Exp(r) R, v + dv, w + dw, Q Exp(q), c + dc, W +
// dW).
class Motion {
 public:
  using Covariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 21, 21>;

  // Of a measured pose, with what is known of velocities: their sigmas.
  Motion(const UncertainRigid3& pad_from_body, double velocity_sigma, double angular_velocity_sigma);

  void propagate(double dt, const BodyNoise& body, const PadNoise& pad);

  // From the first attitude heard on, the pad's part is there.
  bool knows_world() const { return P.rows() > kOfPad; }
  void meet_world(const Eigen::Quaterniond& world_from_body, double attitude_sigma, const PadNoise& pad);
  void forget_world();

  Innovation of_pose(const UncertainRigid3& pad_from_body) const;
  // These need knows_world().
  Innovation of_attitude(const Eigen::Quaterniond& world_from_body, double sigma) const;
  Innovation of_velocity(const Eigen::Vector3d& body_velocity_in_world, double sigma) const;
  Innovation of_angular_velocity(const Eigen::Vector3d& angular_velocity_in_body, double sigma) const;

  // Normalised squares of an innovation, and the logarithm of its density but for a constant. Infinite and
  // minus infinity where it is not finite.
  struct Surprise {
    double squared = 0, log_density = 0;
  };
  Surprise surprise(const Innovation& innovation) const;
  void correct(const Innovation& innovation);

  Rigid3 pad_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          // m/s
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  // rad/s
  Eigen::Quaterniond world_from_pad = Eigen::Quaterniond::Identity();
  Eigen::Vector3d pad_velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d pad_angular_velocity = Eigen::Vector3d::Zero();
  Covariance P;  // 12 rows, 21 with the world

 private:
  static constexpr Eigen::Index kOfPad = 12;

  Covariance transition(double dt) const;
  void add_noise(double dt, const BodyNoise& body, const PadNoise& pad);
};

}  // namespace perch
