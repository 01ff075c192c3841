#pragma once

#include "perch/geometry/uncertainty.h"

namespace perch {

enum class PoseStatus { kOk, kPartial, kAmbiguous, kRejected };

struct PoseResult {
  PoseStatus status = PoseStatus::kRejected;
  UncertainRigid3 camera_from_target;   // meaningful with kOk and kAmbiguous
  UncertainRigid3 second;               // the other minimum of the planar problem, where there is one
  double reprojection_rms_px = 0;       // root of the mean squared distance, over the features
  double ambiguity = 0;                 // cost of the best pose over that of the second: 0 sure, 1 undecidable
  int features = 0;
};

}  // namespace perch
