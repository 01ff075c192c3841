#include "calib/mount/trajectory_states.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

Vector6d six(double position, double rotation) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(position), Eigen::Vector3d::Constant(rotation);
  return sigma;
}

// How many pictures there are for each sample of navigation around a moment.
double pictures_per_sample(std::span<const int64_t> pictures, const NavTrack& nav, int64_t camera_ns,
                           int64_t navigation_ns) {
  constexpr int64_t kAround = 500'000'000;
  const auto within = [](auto begin, auto end) { return static_cast<double>(std::distance(begin, end)); };
  const auto before = [](const NavSample& s, int64_t t) { return s.timestamp_ns < t; };
  const double seen = within(std::lower_bound(pictures.begin(), pictures.end(), camera_ns - kAround),
                             std::upper_bound(pictures.begin(), pictures.end(), camera_ns + kAround));
  const double sampled =
      within(std::lower_bound(nav.samples.begin(), nav.samples.end(), navigation_ns - kAround, before),
             std::lower_bound(nav.samples.begin(), nav.samples.end(), navigation_ns + kAround, before));
  return seen / std::max(sampled, 1.0);
}

}  // namespace

TrajectoryStates::TrajectoryStates(const Trajectory& trajectory, const NavigationNoise& noise,
                                   std::span<const int64_t> camera_ns, double offset)
    : noise_(noise), drifts_(noise.position_drift > 0 || noise.rotation_drift > 0) {
  const int64_t shift = std::llround(1e9 * offset);
  for (const int64_t ns : camera_ns) {
    State state;
    state.time = 1e-9 * static_cast<double>(ns - camera_ns.front());
    const auto point = trajectory.at(ns - shift);
    if (point) state.noise_part = point->noise_part;
    state.noise_part =
        state.noise_part.cwiseMax(pictures_per_sample(camera_ns, trajectory.nav(), ns, ns - shift));
    states_.push_back(state);
  }
}

std::vector<CorrectionPart> TrajectoryStates::parts(size_t picture) {
  State& state = states_[picture];
  std::vector<CorrectionPart> parts = {{state.u.data(), 1}};
  if (drifts_) parts.push_back({state.b.data(), -1});
  return parts;
}

void TrajectoryStates::add_priors(ceres::Problem& problem) {
  for (State& state : states_) {
    const Vector6d sigma = state.noise_part.cwiseSqrt().cwiseProduct(six(noise_.position, noise_.rotation));
    problem.AddResidualBlock(new StatePrior({1}, Vector6d::Zero(), sigma), nullptr, state.u.data());
  }
  if (!drifts_) return;
  // A deviation of 0 is a state that stays 0.
  const Vector6d sigma = six(std::max(noise_.position_drift, 1e-6), std::max(noise_.rotation_drift, 1e-7));
  for (size_t i = 0; i < states_.size(); ++i) {
    if (i == 0) {
      problem.AddResidualBlock(new StatePrior({1}, Vector6d::Zero(), sigma), nullptr, states_[0].b.data());
      continue;
    }
    const double kept = std::exp(-(states_[i].time - states_[i - 1].time) / noise_.drift_time);
    const double added = std::sqrt(std::max(1e-12, 1 - kept * kept));
    problem.AddResidualBlock(new StatePrior({-kept, 1}, Vector6d::Zero(), added * sigma), nullptr,
                             states_[i - 1].b.data(), states_[i].b.data());
  }
}

}  // namespace perch
