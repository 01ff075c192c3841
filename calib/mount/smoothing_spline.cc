#include "calib/mount/smoothing_spline.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/mount/mount_solver.h"

namespace perch {
namespace {

constexpr double kNoiseDimensions = 3;
// The range of q / sigma^2 in steps. At its upper end the curve follows a sample by 0.7, at its lower end
// some sixty samples to either side are averaged; beyond, the system loses its digits.
constexpr double kStiffest = 1e-11, kLoosest = 100;

// The states' transition over d, and the inverse covariance of what white x''' of density 1 adds to it.
Eigen::Matrix3d transition(double d) {
  Eigen::Matrix3d F;
  F << 1, d, d * d / 2, 0, 1, d, 0, 0, 1;
  return F;
}

Eigen::Matrix3d process_information(double d) {
  const double d2 = d * d, d3 = d2 * d;
  Eigen::Matrix3d W;
  W << 720 / (d2 * d3), -360 / (d2 * d2), 60 / d3, -360 / (d2 * d2), 192 / d3, -36 / d2, 60 / d3, -36 / d2,
      9 / d;
  return W;
}

// The quintic between two states d apart, at a part u of the way: weights of (x, x', x'') of both.
struct Quintic {
  Eigen::Matrix<double, 6, 1> value, rate;  // rate by time in the unit of d
};

Quintic quintic(double u, double d) {
  const double u2 = u * u, u3 = u2 * u, u4 = u3 * u, u5 = u4 * u;
  Quintic q;
  q.value << 1 - 10 * u3 + 15 * u4 - 6 * u5, d * (u - 6 * u3 + 8 * u4 - 3 * u5),
      d * d * (0.5 * u2 - 1.5 * u3 + 1.5 * u4 - 0.5 * u5), 10 * u3 - 15 * u4 + 6 * u5,
      d * (-4 * u3 + 7 * u4 - 3 * u5), d * d * (0.5 * u3 - u4 + 0.5 * u5);
  q.rate << (-30 * u2 + 60 * u3 - 30 * u4) / d, 1 - 18 * u2 + 32 * u3 - 15 * u4,
      d * (u - 4.5 * u2 + 6 * u3 - 2.5 * u4), (30 * u2 - 60 * u3 + 30 * u4) / d, -12 * u2 + 28 * u3 - 15 * u4,
      d * (1.5 * u2 - 4 * u3 + 2.5 * u4);
  return q;
}

}  // namespace

double median_step(const std::vector<double>& times) {
  std::vector<double> steps;
  for (size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  if (steps.empty()) return 1;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

SmoothingSpline::SmoothingSpline(std::vector<double> times, const std::vector<Eigen::Vector4d>& samples,
                                 double longest_gap)
    : times_(std::move(times)), longest_gap_(longest_gap), step_(median_step(times_)), nodes_(times_.size()) {
  if (times_.empty()) return;
  // Decades first: the likelihood of a short flight may have more than one top. Then to a tenth, which moves
  // the curve by a hundredth of its deviation.
  double best = kLoosest, least = solve(kLoosest, samples);
  for (double density = kStiffest; density < 0.5 * kLoosest; density *= 10) {
    const double value = solve(density, samples);
    if (value < least) {
      least = value;
      best = density;
    }
  }
  for (double factor = std::sqrt(10.0); factor > 1.1; factor = std::sqrt(factor)) {
    for (const double density : {best / factor, best * factor}) {
      if (density < kStiffest || density > kLoosest) continue;
      const double value = solve(density, samples);
      if (!(value < least)) continue;
      least = value;
      best = density;
      break;
    }
  }
  if (!std::isfinite(solve(best, samples)))
    throw MountError("navigation: no smooth curve goes through its samples");
}

// Fills in the nodes; returns -2 log of the likelihood a noise dimension, but for a constant.
double SmoothingSpline::solve(double density, const std::vector<Eigen::Vector4d>& samples) {
  density_ = density;
  const size_t n = times_.size();
  struct Row {
    Eigen::Matrix3d F, W, back;  // to the next; back = S^-1 F'W
    Eigen::LLT<Eigen::Matrix3d> S;
    States right;
  };
  std::vector<Row> rows(n);
  double log_determinant = 0, freedom = 0;
  size_t length = 0;  // of the piece between gaps so far
  for (size_t i = 0; i < n; ++i) {
    Row& row = rows[i];
    Eigen::Matrix3d S = Eigen::Vector3d(1, 0, 0).asDiagonal();
    row.right.setZero();
    row.right.row(0) = samples[i];
    const bool from_before = i > 0 && joined(i - 1);
    if (from_before) {
      const Row& before = rows[i - 1];
      const Eigen::Matrix3d WF = before.W * before.F;
      S += before.W - WF * before.back;
      row.right += WF * before.S.solve(before.right);
      length += 1;
    } else {
      // A single sample has no rates: next to nothing, and no motion, is known of them beforehand.
      S.diagonal().tail<2>().array() += 1e-9;
      length = 1;
    }
    if (length > 3) freedom += 1;
    if (i + 1 < n && joined(i)) {
      const double d = (times_[i + 1] - times_[i]) / step_;
      row.F = transition(d);
      row.W = process_information(d) / density;
      S += row.F.transpose() * row.W * row.F;
      log_determinant += 3 * std::log(density);
    }
    row.S.compute(S);
    if (row.S.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    log_determinant += 2 * row.S.matrixLLT().diagonal().array().log().sum();
    if (i + 1 < n && joined(i)) row.back = row.S.solve(row.F.transpose() * row.W);
  }
  double cost = 0;
  for (size_t i = n; i-- > 0;) {
    const Row& row = rows[i];
    Node& node = nodes_[i];
    node.state = row.S.solve(row.right);
    node.covariance = row.S.solve(Eigen::Matrix3d::Identity());
    if (i + 1 < n && joined(i)) {
      const Node& next = nodes_[i + 1];
      node.state += row.back * next.state;
      node.with_next = row.back * next.covariance;
      node.covariance += node.with_next * row.back.transpose();
      const States jump = next.state - row.F * node.state;
      cost += jump.cwiseProduct(row.W * jump).sum();
    }
    cost += (samples[i] - node.state.row(0).transpose()).squaredNorm();
  }
  if (freedom < 10) {  // of fewer no noise can be told: they are met
    noise_ = 0;
    return -density;
  }
  const double variance = cost / (kNoiseDimensions * freedom);
  noise_ = std::sqrt(variance);
  return freedom * std::log(std::max(variance, 1e-300)) + log_determinant;
}

std::optional<SmoothingSpline::Point> SmoothingSpline::at(double time) const {
  const auto after = std::lower_bound(times_.begin(), times_.end(), time);
  if (after == times_.end()) return std::nullopt;
  const auto i = static_cast<size_t>(after - times_.begin());
  if (*after == time) {
    return Point{nodes_[i].state.row(0), nodes_[i].state.row(1) / step_, nodes_[i].covariance(0, 0)};
  }
  if (i == 0 || !joined(i - 1)) return std::nullopt;
  const Node &a = nodes_[i - 1], &b = nodes_[i];
  const double d = (times_[i] - times_[i - 1]) / step_,
               u = (time - times_[i - 1]) / (times_[i] - times_[i - 1]);
  const Quintic q = quintic(u, d);
  Eigen::Matrix<double, 6, 4> states;
  states << a.state, b.state;
  Eigen::Matrix<double, 6, 6> covariance;
  covariance << a.covariance, a.with_next, a.with_next.transpose(), b.covariance;
  // And what the motion may do between the two: d^5 (u (1 - u))^5 / 20 of the density.
  return Point{states.transpose() * q.value, states.transpose() * q.rate / step_,
               q.value.dot(covariance * q.value) + density_ * std::pow(d * u * (1 - u), 5) / 20};
}

}  // namespace perch
