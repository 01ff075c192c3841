#pragma once

#include <cstdint>
#include <optional>

#include "perch/links/mavlink/state_texts.h"
#include "perch/tracking/vehicle_state.h"

namespace perch::mavlink {

// What becomes of the pad's state as frames come, and when they do not:
//
//            pose                  frame without, or none for kFrameMissing
//   SEARCH --------> TRACK <------------------------------------------------> COAST
//                      ^                                                        |
//                      +-- pose -- LOST <-- no pose for `coast` seconds --------+
class PadWatch {
 public:
  explicit PadWatch(double coast);

  // The estimate of a frame, `now_ns` the time at which it is there.
  void see(const std::optional<VehicleState>& state, int64_t now_ns);
  PadState at(int64_t now_ns) const;

  // Three frames of a camera of 15 Hz.
  static constexpr int64_t kFrameMissing = 200'000'000;

 private:
  int64_t coast_ns_;
  PadState state_ = PadState::kSearch;  // of the last frame
  int64_t last_frame_ns_ = 0;
  int64_t last_pose_ns_ = 0;
};

}  // namespace perch::mavlink
