#include "perch/simulation/deck.h"

#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {

Swell::Swell(double deviation, double period, RandomStream& random)
    : amplitude_(deviation * std::sqrt(2.0 / kSines)) {
  const double modal = 2 * M_PI / period;
  for (int k = 0; k < kSines; ++k) {
    // One sine from each twenty-fourth of the spectrum, but not from the last fiftieth: a hull does not feel
    // waves that are much shorter than itself.
    const double u = 0.98 * (k + random.uniform(0.01, 1)) / kSines;
    sines_[static_cast<size_t>(k)] = {modal * std::pow(1.25 / -std::log(u), 0.25),
                                      random.uniform(0, 2 * M_PI)};
  }
}

double Swell::sum(double t, int derivative) const {
  double total = 0;
  for (const auto& [w, phase] : sines_) {
    total += amplitude_ * std::pow(w, derivative) * std::sin(w * t + phase + derivative * M_PI / 2);
  }
  return total;
}

Deck::Deck(const std::optional<DeckOptions>& options, const Rigid3& world_from_pad_at_rest, uint64_t seed)
    : at_rest_(world_from_pad_at_rest),
      moves_(options.has_value()),
      random_(seed),
      heave_(options.value_or(DeckOptions{}).heave, options.value_or(DeckOptions{}).period, random_),
      sway_(options.value_or(DeckOptions{}).sway, options.value_or(DeckOptions{}).period, random_),
      roll_(options.value_or(DeckOptions{}).roll, options.value_or(DeckOptions{}).roll_period, random_),
      pitch_(options.value_or(DeckOptions{}).pitch, options.value_or(DeckOptions{}).period, random_) {}

PadTruth Deck::at(double t) const {
  if (!moves_) return {at_rest_, {0, 0, 0}, {0, 0, 0}};
  const Eigen::Vector3d bow = Eigen::Vector3d::UnitY(), starboard = Eigen::Vector3d::UnitX();
  const Eigen::Quaterniond rolled = so3_exp(roll_.value(t) * bow);
  const Eigen::Quaterniond pitched = so3_exp(pitch_.value(t) * starboard);
  PadTruth truth;
  truth.world_from_pad = at_rest_ * Rigid3{rolled * pitched, {sway_.value(t), 0, heave_.value(t)}};
  truth.pad_velocity_in_world = at_rest_.rotation * Eigen::Vector3d(sway_.rate(t), 0, heave_.rate(t));
  truth.angular_velocity_in_pad = pitch_.rate(t) * starboard + pitched.conjugate() * (roll_.rate(t) * bow);
  return truth;
}

}  // namespace perch
