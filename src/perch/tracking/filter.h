#pragma once

#include <deque>
#include <optional>

#include "perch/geometry/uncertainty.h"
#include "perch/tracking/autopilot_sample.h"
#include "perch/tracking/motion_bank.h"
#include "perch/tracking/tracking_options.h"
#include "perch/tracking/vehicle_state.h"

namespace perch {

// The vehicle's pose and velocity in the pad frame: error-state Kalman filters with constant velocity
// (Motion, several at a time: MotionBank), fed by the poses of the frames and by what the autopilot says.
//
//            first measured pose                      none for `coast` seconds
//   (none) ----------------------> vision <--> predicted ----------------------> lost --measured pose-->
//   vision
//
// Every measurement is taken at its own time, in whatever order they come: those of the last `history`
// seconds are kept with the state after each, and a late one is put in its place and the rest done again. The
// state at a time is that of all measurements up to it; so the result is the same, to the last bit, as if all
// had come in order.
class VehicleFilter {
 public:
  explicit VehicleFilter(const TrackingOptions& options);

  // The state at a frame's time, with the pose measured in that frame where there is one. Empty before the
  // first measured pose. A time earlier than the last frame's by more than the history is a clock that went
  // back: tracking starts anew. A second pose of the same time changes nothing. One that is not finite, or
  // whose covariance is none, counts as none.
  std::optional<VehicleState> update(int64_t timestamp_ns,
                                     const std::optional<UncertainRigid3>& pad_from_body);

  // What the autopilot says; ignored where it is not finite, too late, or more than a second ahead of the
  // last frame (another clock). It never starts tracking, nor prolongs it; but the last that was said before
  // the first measured pose tells how fast the body is then.
  void hear(const AutopilotSample& sample);

  // Where the body is or will be, without changing anything; empty when not tracking, and for times that the
  // history does not reach.
  std::optional<VehicleState> predict(int64_t timestamp_ns) const;

  // The same with a covariance that allows for all a lively body could do, however calm it was of late: where
  // to look for the pad, and how far to trust what is expected against what is seen.
  std::optional<VehicleState> predict_widely(int64_t timestamp_ns) const;

 private:
  struct Event {
    int64_t timestamp_ns = 0;
    std::optional<UncertainRigid3> pad_from_body;  // else:
    AutopilotSample sample;
  };
  // The latest of each part that the autopilot said, and what it tells of another time, with what a lively
  // body may have changed since in the sigmas; nothing older than `oldest` s.
  struct Heard {
    AutopilotSample attitude, velocity, angular_velocity;
    void take(const AutopilotSample& sample);
    AutopilotSample at(int64_t timestamp_ns, double oldest) const;
  };
  // All that is known after an event.
  struct Known {
    explicit Known(const TrackingOptions& options);
    bool tracking = false;
    bool believed = false;                     // the pose, when the event was one
    std::optional<double> innovation_squared;  // of that pose, as it was expected
    int64_t timestamp_ns = 0;
    int64_t last_measured_ns = 0;
    int refused = 0;  // measured poses in a row
    Heard heard;
    MotionBank bank;
  };
  struct Entry {
    Event event;
    Known after;
  };

  bool is_tracking(const Known& known, int64_t timestamp_ns) const;
  Known after(const Known& before, const Event& event) const;
  void insert(const Event& event);
  void forget_before(int64_t timestamp_ns);
  const Known& known_at(int64_t timestamp_ns) const;

  TrackingOptions options_;
  Known base_;  // before the first entry
  std::deque<Entry> history_;
  std::optional<int64_t> last_frame_ns_;
  std::optional<VehicleState> last_state_;
};

}  // namespace perch
