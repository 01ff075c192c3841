#include "calib/mount/trajectory_states.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace perch {
namespace {

Vector6d six(double position, double rotation) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(position), Eigen::Vector3d::Constant(rotation);
  return sigma;
}

}  // namespace

TrajectoryStates::TrajectoryStates(const Trajectory& trajectory, const NavigationNoise& noise,
                                   std::span<const int64_t> camera_ns, double offset)
    : trajectory_(trajectory), noise_(noise), drifts_(noise.position_drift > 0 || noise.rotation_drift > 0) {
  // Half of the curve's window: what the curve flattens, the states can follow.
  if (trajectory.smooth()) spacing_ = trajectory.half_window();
  const int64_t shift = std::llround(1e9 * offset);
  if (!camera_ns.empty()) start_ns_ = camera_ns.front() - shift;
  for (size_t i = 0; i < camera_ns.size(); ++i) {
    const int64_t ns = camera_ns[i] - shift;
    const double t = 1e-9 * static_cast<double>(ns - start_ns_);
    Place place;
    if (const auto point = trajectory.at(ns)) place.noise_part = point->noise_part;
    if (trajectory.smooth()) {
      const auto cell = static_cast<int64_t>(std::floor(t / spacing_));
      place.a = &nodes_[cell];
      place.b = &nodes_[cell + 1];
      place.a->time = static_cast<double>(cell) * spacing_;
      place.b->time = place.a->time + spacing_;
      place.s = t / spacing_ - static_cast<double>(cell);
      cells_.push_back(cell);
    } else {
      place.a = &nodes_[static_cast<int64_t>(i)];
      place.a->time = t;
    }
    places_.push_back(place);
  }
}

std::vector<CorrectionPart> TrajectoryStates::parts(size_t picture) {
  const Place& p = places_[picture];
  std::vector<CorrectionPart> parts = {{p.a->measured.data(), 1 - p.s}};
  if (p.b) parts.push_back({p.b->measured.data(), p.s});
  if (drifts_) {
    parts.push_back({p.a->drift.data(), -(1 - p.s)});
    if (p.b) parts.push_back({p.b->drift.data(), -p.s});
  }
  return parts;
}

// u of the cell's two states fits the samples in it, (1 - s) a + s b = sample - curve: the square root of
// that normal equation, two rows a number.
void TrajectoryStates::add_samples(ceres::Problem& problem, const Place& place, int64_t cell) const {
  const auto& samples = trajectory_.nav().samples;
  const int64_t begin = start_ns_ + std::llround(1e9 * spacing_ * static_cast<double>(cell));
  const int64_t end = start_ns_ + std::llround(1e9 * spacing_ * static_cast<double>(cell + 1));
  auto it = std::lower_bound(samples.begin(), samples.end(), begin,
                             [](const NavSample& s, int64_t t) { return s.timestamp_ns < t; });
  // Where no sample is near, a state is as uncertain as a single one.
  Eigen::Matrix2d N = 1e-2 * Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 2, 6> g = Eigen::Matrix<double, 2, 6>::Zero();
  for (; it != samples.end() && it->timestamp_ns < end; ++it) {
    const auto curve = trajectory_.at(it->timestamp_ns);
    if (!curve) continue;
    const double s = 1e-9 * static_cast<double>(it->timestamp_ns - begin) / spacing_;
    const Eigen::Vector2d h(1 - s, s);
    N += h * h.transpose();
    g += h * pose_error(curve->world_from_body, it->world_from_body).transpose();
  }
  const Eigen::Matrix2d L = N.llt().matrixL();
  const Eigen::Matrix<double, 2, 6> y = L.triangularView<Eigen::Lower>().solve(g);
  const Vector6d sigma = six(noise_.position, noise_.rotation);
  for (Eigen::Index row = 0; row < 2; ++row) {
    problem.AddResidualBlock(new StatePrior({L(0, row), L(1, row)}, y.row(row).transpose(), sigma), nullptr,
                             place.a->measured.data(), place.b->measured.data());
  }
}

void TrajectoryStates::add_priors(ceres::Problem& problem) {
  for (size_t i = 0; i < places_.size(); ++i) {
    const Place& p = places_[i];
    if (!p.b) {
      problem.AddResidualBlock(
          new StatePrior({1}, Vector6d::Zero(),
                         std::sqrt(p.noise_part) * six(noise_.position, noise_.rotation)),
          nullptr, p.a->measured.data());
    } else if (i == 0 || cells_[i] != cells_[i - 1]) {
      add_samples(problem, p, cells_[i]);
    }
  }
  if (!drifts_) return;
  // A deviation of 0 is a state that stays 0.
  const Vector6d sigma = six(std::max(noise_.position_drift, 1e-6), std::max(noise_.rotation_drift, 1e-7));
  Node* before = nullptr;
  for (auto& [key, node] : nodes_) {
    if (!before) {
      problem.AddResidualBlock(new StatePrior({1}, Vector6d::Zero(), sigma), nullptr, node.drift.data());
    } else {
      const double kept = std::exp(-(node.time - before->time) / noise_.drift_time);
      const double added = std::sqrt(std::max(1e-12, 1 - kept * kept));
      problem.AddResidualBlock(new StatePrior({-kept, 1}, Vector6d::Zero(), added * sigma), nullptr,
                               before->drift.data(), node.drift.data());
    }
    before = &node;
  }
}

}  // namespace perch
