#include "calib/mount/wander.h"

#include <cmath>
#include <sstream>

#include "calib/mount/pose_gate.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

constexpr size_t kPieces = 12;
// Twelve pieces of three axes, of which a fit takes six or so: a mean square of 2.2 is chance once in 10 000.
constexpr double kChance = 1.5;

// Variance of the mean of an Ornstein-Uhlenbeck process over a time, over its own.
double kept_by_mean(double time, double correlation) {
  const double x = time / correlation;
  return x < 1e-3 ? 1 : 2 / x * (1 - (1 - std::exp(-x)) / x);
}

struct Sum {
  double n = 0;
  Vector6d errors = Vector6d::Zero(), variance = Vector6d::Zero(), part = Vector6d::Zero();
};

std::string number(double value) {
  std::ostringstream text;
  text.precision(2);
  text << value;
  return text.str();
}

}  // namespace

Wander wander(const MountProblem& problem, const MountSolution& solution, size_t f) {
  const FlightFit& fit = solution.flights[f];
  const NoiseSamples samples = noise_samples(problem, solution, f);
  if (samples.times.empty()) return {};
  const double begin = samples.times.front(), span = samples.times.back() - begin;
  Wander w;
  w.piece = span / kPieces;
  std::array<Sum, kPieces> sums;
  for (size_t k = 0; k < samples.times.size(); ++k) {
    const size_t picture = samples.pictures[k];
    if (!fit.used[picture] || !fit.after[picture]) continue;
    const double at = kPieces * (samples.times[k] - begin) / span;
    Sum& sum = sums[std::min(kPieces - 1, static_cast<size_t>(std::max(0.0, at)))];
    sum.n += 1;
    sum.errors += *fit.after[picture];  // of the pose that the gate chose of a plane's two
    sum.variance += samples.camera_variance[k];
    sum.part += samples.noise_part[k];
  }
  const NavigationNoise& noise = fit.noise;
  Vector6d white, drift;
  white << Eigen::Vector3d::Constant(noise.position), Eigen::Vector3d::Constant(noise.rotation);
  drift << Eigen::Vector3d::Constant(noise.position_drift), Eigen::Vector3d::Constant(noise.rotation_drift);
  Vector6d squared = Vector6d::Zero(), rest = Vector6d::Zero();
  double pieces = 0;
  for (const Sum& sum : sums) {
    if (sum.n < 4) continue;
    const Vector6d mean = sum.errors / sum.n;
    // Pictures do not make more of navigation's samples than there are.
    const Vector6d part = (sum.part / (sum.n * sum.n)).cwiseMax(fit.trajectory.step() / w.piece);
    const Vector6d expected = sum.variance / (sum.n * sum.n) + part.cwiseProduct(white.cwiseAbs2()) +
                              kept_by_mean(w.piece, noise.drift_time) * drift.cwiseAbs2();
    squared += mean.cwiseAbs2().cwiseQuotient(expected);
    rest += mean.cwiseAbs2() - expected;
    pieces += 1;
  }
  if (pieces < kPieces / 2) return w;
  // Six of each kind's numbers are fitted away: mount and pad.
  const double freedom = 3 * pieces - 6;
  w.position = std::sqrt(squared.head<3>().sum() / freedom);
  w.rotation = std::sqrt(squared.tail<3>().sum() / freedom);
  w.position_rest = std::sqrt(std::max(0.0, rest.head<3>().sum() / freedom));
  w.rotation_rest = std::sqrt(std::max(0.0, rest.tail<3>().sum() / freedom));
  return w;
}

std::string in_words(const Wander& w) {
  const double most = std::max(w.position, w.rotation);
  if (!(most > kChance)) return "";
  std::string keys;
  const auto add = [&](double ratio, double rest, const char* key) {
    if (ratio > kChance) keys += std::string(keys.empty() ? "" : ", ") + key + ": " + number(rest);
  };
  add(w.position, w.position_rest, "position_drift");
  add(w.rotation, kDegFromRad * w.rotation_rest, "rotation_drift_deg");
  return "navigation minus vision is not noise: its means over " + number(w.piece) + " s scatter by " +
         number(most) +
         " times what the noise found allows, and the deviations stated may be as many times too small; "
         "calibrate_mount.navigation: {" +
         keys + ", drift_time: " + number(w.piece) + "} would account for it";
}

}  // namespace perch
