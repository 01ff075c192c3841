#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "perch/geometry/rigid3.h"
#include "perch/simulation/random.h"

namespace perch {

// How a small ship moves the pad on its deck: one deviation of each motion. The defaults are sea state 4 with
// its mean significant wave height of 1.88 m and most probable modal period of 8.8 s (Bales, Lee, Voelker,
// "Standardized wave and wind environments for NATO operational areas", DTNSRDC/SPD-0919-01, 1981): shorter
// than half a wave, the ship heaves as the water does, a quarter of that height; roll and pitch are the
// limits of helicopters on deck, 5 and 3 degrees of significant amplitude, which is two deviations.
struct DeckOptions {
  double heave = 0.47;     // of the pad, m
  double sway = 0.25;      // m
  double roll = 0.0436;    // rad
  double pitch = 0.0262;   // rad
  double period = 8.8;     // of the waves, where their spectrum is highest, s
  double roll_period = 7;  // a ship rolls in its own time, s
};

// Where the pad is at a moment, and how it moves.
struct PadTruth {
  Rigid3 world_from_pad;
  Eigen::Vector3d pad_velocity_in_world = Eigen::Vector3d::Zero();    // of its origin, m/s
  Eigen::Vector3d angular_velocity_in_pad = Eigen::Vector3d::Zero();  // of the pad in the world, rad/s
};

// A random motion with the waves' spectrum: a sum of sines x(t) = deviation sqrt(2 / n) sum_k sin(w_k t +
// phi_k), their frequencies drawn from Bretschneider's spectrum
//
//   S(w) ~ w^-5 exp(-1.25 (w_m / w)^4),   w_m = 2 pi / period,   quantile w(u) = w_m (1.25 / -ln u)^(1/4).
class Swell {
 public:
  Swell(double deviation, double period, RandomStream& random);
  double value(double t) const { return sum(t, 0); }
  double rate(double t) const { return sum(t, 1); }  // d/dt

 private:
  static constexpr int kSines = 24;
  struct Sine {
    double frequency = 0, phase = 0;  // rad/s, rad
  };
  double sum(double t, int derivative) const;

  double amplitude_;
  std::array<Sine, kSines> sines_;
};

// The pad of a simulation: at rest, or on a deck whose bow is the pad's y axis. Then
//
//   world_from_pad(t) = at rest * (Ry(roll) Rx(pitch), (sway, 0, heave)).
//
// The same seed moves the same way.
class Deck {
 public:
  Deck(const std::optional<DeckOptions>& options, const Rigid3& world_from_pad_at_rest, uint64_t seed);

  PadTruth at(double t) const;  // s since the start
  bool moves() const { return moves_; }

 private:
  Rigid3 at_rest_;
  bool moves_;
  RandomStream random_;
  Swell heave_, sway_, roll_, pitch_;
};

}  // namespace perch
