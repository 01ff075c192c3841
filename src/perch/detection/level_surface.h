#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace perch {

// A grey level at a place of the picture, as one piece of an edge tells it.
struct LevelSample {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double value = 0, variance = 1;  // grey levels
};

// A grey level of the target, white or black, over the part of the picture that it takes up: of second order,
// as light, vignetting and a lens make it; where a shadow falls on part of it, a part of that there; and how
// far single places are off it (glare, dirt, a shadow's soft edge).
class LevelSurface {
 public:
  // The surface that most samples agree about. Where they are too few or disagree, the spread is large and
  // the surface binds nobody.
  void fit(std::span<const LevelSample> samples);

  struct Level {
    double value = 0;
    double variance = 1e6;                               // beyond the range of greys: nothing is known
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  // grey levels a px
    double gradient_sigma = 0;                           // of each of both
  };
  // In the light or in the shadow, whichever is nearer to the `own` level of the place.
  Level at(const Eigen::Vector2d& pixel, double own) const;

 private:
  using Coefficients = Eigen::Matrix<double, 6, 1>;  // of 1, u, v, u^2, uv, v^2
  // The surface, what a shadow leaves of it (1 where there is none), and the spread about both.
  struct Fitted {
    Coefficients x = Coefficients::Zero();
    double shade = 1;
    Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
    double variance = Level{}.variance;
  };
  Coefficients row_at(const Eigen::Vector2d& pixel) const;
  Fitted evenly_lit(std::span<const LevelSample> samples, int unknowns) const;
  std::optional<Fitted> shaded(std::span<const LevelSample> samples, int unknowns);

  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  double reach_ = 1;
  std::vector<Coefficients> rows_;  // working memory, as is the next
  std::vector<double> sorted_;
  Fitted fitted_;
};

}  // namespace perch
