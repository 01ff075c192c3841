#include "perch/analysis/detections.h"

namespace perch {

Detections count_detections(std::span<const FrameRecord> frames) {
  Detections detections;
  detections.frames = frames.size();
  bool in_gap = false;
  for (size_t i = 0; i < frames.size(); ++i) {
    const FrameRecord& frame = frames[i];
    const auto status = static_cast<size_t>(frame.status);
    ++detections.counts[status];
    if (in_gap) {
      Gap& gap = detections.gaps.back();
      gap.duration = 1e-9 * static_cast<double>(frame.timestamp_ns - frames[gap.first_frame].timestamp_ns);
    }
    if (frame.status == EstimateStatus::kOk) {
      in_gap = false;
      continue;
    }
    if (!in_gap) {
      const double start = 1e-9 * static_cast<double>(frame.timestamp_ns - frames.front().timestamp_ns);
      detections.gaps.push_back({.first_frame = i, .start = start});
      in_gap = true;
    }
    ++detections.gaps.back().frames;
    ++detections.gaps.back().reasons[status];
  }
  if (!frames.empty()) {
    detections.rate = static_cast<double>(detections.counts[0]) / static_cast<double>(frames.size());
  }
  return detections;
}

}  // namespace perch
