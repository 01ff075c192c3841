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

// As how many pixels together those of a textured ground count, where an edge is fitted to them: through the
// blur, by its mean square in px^2, they err alike. 2 sqrt(pi) sigma along the edge; across it, seen with a
// blurred step's slope, sqrt(2 pi) sigma.
double texture_together(double blur_px2);

}  // namespace perch
