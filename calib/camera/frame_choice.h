#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "calib/camera/corner_cache.h"

namespace perch {

// How sharp a picture is beside its neighbours, which show much the same: the energy of its gradients.
double sharpness(const cv::Mat& grey);

// Where a board is in the picture and how it is turned, in numbers of about equal weight: two views with the
// same say the same about the lens. Place (2) and size as parts of the picture, and how its sides converge
// (2), which is tilt.
using ViewTraits = Eigen::Matrix<double, 5, 1>;
ViewTraits view_traits(const FoundBoard& found, const BoardGrid& grid);

// Nearer than this two views are one.
inline constexpr double kDistinct = 0.06;

// Of many views those that differ most, `most` at most: each is the farthest from those before it. In the
// order of the views.
std::vector<size_t> choose_distinct(const std::vector<ViewTraits>& views, size_t most);

}  // namespace perch
