#pragma once

#include <gmock/gmock.h>

#include <limits>

#include "perch/geometry/rigid3.h"

namespace perch {

inline constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Passes when both errors are within bounds; a NaN is within no bound.
MATCHER_P3(IsNearPose, expected, max_rad, max_m, "") {
  const double rad = arg.rotation.angularDistance(expected.rotation);
  const double m = (arg.translation - expected.translation).norm();
  *result_listener << "off by " << rad << " rad and " << m << " m";
  return rad <= max_rad && m <= max_m;
}

// Every element within `tolerance`; sizes must agree. Takes any Eigen expression.
MATCHER_P2(IsNearMatrix, expected, tolerance, "") {
  if (arg.rows() != expected.rows() || arg.cols() != expected.cols()) return false;
  const double worst = (arg - expected).cwiseAbs().maxCoeff();
  *result_listener << "off by " << worst;
  return (arg - expected).allFinite() && worst <= tolerance;
}

}  // namespace perch
