#pragma once

#include <span>
#include <string>
#include <vector>

#include "perch/analysis/statistics.h"
#include "perch/estimator/estimate.h"

namespace perch {

// The paper's table 3.2: what each stage of processing costs.
struct StageCost {
  std::string stage;
  Statistics us;     // over the frames in which the stage ran
  double share = 0;  // of all frames' total time
};

struct StageCosts {
  std::vector<StageCost> stages;  // in the order they first ran; "other" is what no stage accounts for
  Statistics total_us;            // of a frame that could be read
};

StageCosts measure_stage_costs(std::span<const Estimate> estimates);

}  // namespace perch
