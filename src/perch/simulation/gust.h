#pragma once

#include <Eigen/Core>
#include <array>

#include "perch/simulation/random.h"

namespace perch {

// A random motion along three axes, of a given deviation, that forgets itself after `correlation` s: what
// gusts do to a vehicle that is held in place. A sum of sines, their frequencies drawn from the spectrum of
// an Ornstein-Uhlenbeck process up to w = 6 / correlation:
//
//   x(t) = deviation sqrt(2 / n) sum_k sin(w_k t + phi_k)
//
// so that its velocity and acceleration are exact at every moment, which filtered white noise has not.
class Gust {
 public:
  Gust(double deviation, double correlation, RandomStream& random);

  Eigen::Vector3d value(double t) const { return sum(t, 0); }
  Eigen::Vector3d rate(double t) const { return sum(t, 1); }          // d/dt
  Eigen::Vector3d acceleration(double t) const { return sum(t, 2); }  // d2/dt2

 private:
  static constexpr int kSines = 12;
  struct Sine {
    double frequency = 0, phase = 0;  // rad/s, rad
  };
  Eigen::Vector3d sum(double t, int derivative) const;

  double amplitude_;
  std::array<std::array<Sine, kSines>, 3> axes_;
};

}  // namespace perch
