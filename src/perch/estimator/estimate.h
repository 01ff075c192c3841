#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "perch/detection/detector.h"
#include "perch/geometry/uncertainty.h"
#include "perch/tracking/vehicle_state.h"

namespace perch {

// The `status` column of estimates.csv.
enum class EstimateStatus { kOk, kNoTarget, kPartial, kAmbiguous, kRejected, kUnreadable };

const char* to_string(EstimateStatus status);

// What the estimator says of one frame: a row of estimates.csv and of states.csv.
struct Estimate {
  int64_t timestamp_ns = 0;
  EstimateStatus status = EstimateStatus::kNoTarget;
  UncertainRigid3 camera_from_target;  // with kOk only
  double reprojection_rms_px = 0;
  int features = 0;      // how many correspondences the pose rests on
  double ambiguity = 0;  // 0: no doubt, 1: undecidable
  double detect_us = 0, pose_us = 0, total_us = 0;
  std::vector<StageTime> stages;  // every step, in order, also those inside `detect_us` and `pose_us`
  std::vector<Correspondence> correspondences;
  std::vector<EdgeResidual> residuals;
  int threshold = -1;                            // grey level, where the method had one
  std::string problem;                           // with kUnreadable: "place: cause"
  std::optional<UncertainRigid3> pad_from_body;  // with kOk, through the frame chain; but for a head's unknown angles
  std::optional<VehicleState> state;             // from the first detection on
};

}  // namespace perch
