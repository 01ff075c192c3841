#pragma once

#include <Eigen/Core>

#include "calib/camera/lens_covariance.h"

namespace perch {

// Where two lens models of one camera project the same far point to: `other` minus `one` over the picture,
// px, after the rotation that makes them agree best. Each has its own idea of where its frame looks; a
// rotation between them is no error of either.
struct ModelDifference {
  SensorMap length;                    // of the difference, px; NaN where one of them sees nothing
  std::vector<Eigen::Vector2d> shift;  // the same with its direction, in the map's order
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // rad, from `one` to `other`
};

// `weight` says how much a place counts for the rotation (0: not), as long as the maps have places.
ModelDifference model_difference(const CameraModel& one, const CameraModel& other, int columns, int rows,
                                 const std::vector<double>& weight);

}  // namespace perch
