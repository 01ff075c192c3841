#pragma once

#include <array>
#include <span>
#include <vector>

#include "perch/analysis/frame_record.h"

namespace perch {

// In the order of EstimateStatus.
inline constexpr std::array<EstimateStatus, 6> kStatuses = {
    EstimateStatus::kOk,        EstimateStatus::kNoTarget, EstimateStatus::kPartial,
    EstimateStatus::kAmbiguous, EstimateStatus::kRejected, EstimateStatus::kUnreadable};

using StatusCounts = std::array<size_t, kStatuses.size()>;  // one count a status

// A run of frames without a pose.
struct Gap {
  size_t first_frame = 0;
  size_t frames = 0;
  // From the first frame without a pose to the next one with, or to the last frame of all, s.
  double start = 0;  // after the flight's first frame
  double duration = 0;
  StatusCounts reasons{};
};

struct Detections {
  size_t frames = 0;
  StatusCounts counts{};
  double rate = 0;  // frames with a pose over all frames; 0 of none
  std::vector<Gap> gaps;
};

Detections count_detections(std::span<const FrameRecord> frames);

}  // namespace perch
