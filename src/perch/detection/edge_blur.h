#pragma once

#include <Eigen/Core>
#include <span>

namespace perch {

// How wide one piece of an edge is in the picture.
struct WidthSample {
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();  // unit
  double squared = 0;                                // the blur's deviation across it, squared, px^2
  double variance = 1;                               // of that
};

// The picture's blur as the covariance (px^2) of a point's image: its squared deviation across an edge of
// normal n is n' C n. A round one of about the expected width, wider and stretched (motion) as far as the
// samples agree in it.
Eigen::Matrix2d fit_blur(std::span<const WidthSample> samples, double expected_px);

}  // namespace perch
