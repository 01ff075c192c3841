#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace perch {

// Of ascending times; 1 of fewer than two.
double median_step(const std::vector<double>& times);

// A motion on up to four axes, freed from the white noise of its samples:
//
//   x''' is white noise of density q,   y_i = x(t_i) + n_i,   n_i ~ N(0, sigma^2)
//
// What x is most likely, given all y, is a quintic smoothing spline (Wahba 1978, J. R. Statist. Soc. B 40):
// twice differentiable everywhere, so that a least squares over time sees no kinks. It is found as a
// block-tridiagonal system of (x, x', x'') at the samples, with its covariance; between two samples the mean
// is the quintic that joins their states. sigma and q are those of the greatest (restricted) likelihood:
// samples without noise are met, noisy ones are averaged over as long as the motion allows.
class SmoothingSpline {
 public:
  // `times` ascending, s. Samples further apart than `longest_gap` are nothing to each other. The noise has
  // three dimensions in four axes: a position beside a zero, or a unit quaternion, whose length has no noise.
  SmoothingSpline(std::vector<double> times, const std::vector<Eigen::Vector4d>& samples, double longest_gap);

  struct Point {
    Eigen::Vector4d value, rate;  // rate: the value's exact derivative, 1/s
    double variance_part = 1;     // of the value, over sigma^2
  };
  // Empty beyond the ends and in gaps.
  std::optional<Point> at(double time) const;

  double step() const { return step_; }    // the median one between samples, s
  double noise() const { return noise_; }  // sigma; 0: too few samples to tell

 private:
  using States = Eigen::Matrix<double, 3, 4>;  // x, x', x'' of each axis, time in steps
  struct Node {
    States state;
    Eigen::Matrix3d covariance, with_next;  // over sigma^2
  };
  double solve(double density, const std::vector<Eigen::Vector4d>& samples);
  bool joined(size_t i) const { return times_[i + 1] - times_[i] <= longest_gap_; }

  std::vector<double> times_;
  double longest_gap_;
  double step_ = 1;     // s, the usual one: the unit of time inside
  double density_ = 0;  // q over sigma^2, in steps
  double noise_ = 0;
  std::vector<Node> nodes_;
};

}  // namespace perch
