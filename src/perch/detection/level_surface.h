#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace perch {

// A grey level at a place of the picture, as one piece of an edge tells it.
struct LevelSample {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double value = 0, variance = 1;  // grey levels
};

// A grey level of the target, white or black, over the part of the picture that it takes up: of second order,
// as light, vignetting and a lens make it; and how far single places are off it (shadows, glare, dirt).
class LevelSurface {
 public:
  // The surface that most samples agree about. Where they are too few or disagree, the spread is large and
  // the surface binds nobody.
  void fit(std::span<const LevelSample> samples);

  struct Level {
    double value = 0;
    double variance = 1e6;                               // beyond the range of greys: nothing is known
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  // grey levels a px
  };
  Level at(const Eigen::Vector2d& pixel) const;

 private:
  using Coefficients = Eigen::Matrix<double, 6, 1>;  // of 1, u, v, u^2, uv, v^2
  Coefficients row_at(const Eigen::Vector2d& pixel) const;

  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  double reach_ = 1;
  std::vector<Coefficients> rows_;  // working memory
  Coefficients x_ = Coefficients::Zero();
  Eigen::Matrix<double, 6, 6> covariance_ = Eigen::Matrix<double, 6, 6>::Zero();
  double variance_ = 1e6;
};

}  // namespace perch
