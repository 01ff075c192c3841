#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "perch/estimator/estimator.h"
#include "perch/flight/flight.h"
#include "perch/flight/recorded_aids.h"

namespace perch {

// What the estimator is given beside each picture of a recorded flight, frame by frame in their order: what a
// live run's was given where the flight is one of a live run, else what its navigation and gimbal say.
class FlightAids {
 public:
  // `flight` must outlive this.
  FlightAids(const Flight& flight, const FrameChain& chain, const RunConfig& config);

  Estimator::Aid at(int64_t camera_time_ns);
  // After the last frame.
  std::vector<std::string> problems() const;

 private:
  Estimator::Aid from_flight(int64_t camera_time_ns);
  std::vector<AutopilotSample> said_until(int64_t camera_time_ns);

  const Flight& flight_;
  const FrameChain chain_;
  const bool fuse_navigation_;
  std::optional<RecordedAids> recorded_;
  size_t next_ = 0;                // of the navigation's samples
  int frames_ = 0, headless_ = 0;  // without the angles of their pan/tilt head
};

}  // namespace perch
