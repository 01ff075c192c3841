#include "perch/links/mavlink/pad_watch.h"

#include <cmath>

namespace perch::mavlink {

PadWatch::PadWatch(double coast) : coast_ns_(std::llround(coast * 1e9)) {}

void PadWatch::see(const std::optional<VehicleState>& state, int64_t now_ns) {
  if (!state) return;
  last_frame_ns_ = now_ns;
  switch (state->source) {
    case StateSource::kVision:
      state_ = PadState::kTrack;
      last_pose_ns_ = now_ns;
      return;
    case StateSource::kPredicted:
      state_ = PadState::kCoast;
      return;
    case StateSource::kLost:
      state_ = PadState::kLost;
  }
}

PadState PadWatch::at(int64_t now_ns) const {
  if (state_ == PadState::kSearch || state_ == PadState::kLost) return state_;
  if (now_ns - last_pose_ns_ > coast_ns_ + kFrameMissing) return PadState::kLost;
  return now_ns - last_frame_ns_ > kFrameMissing ? PadState::kCoast : state_;
}

}  // namespace perch::mavlink
