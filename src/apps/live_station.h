#pragma once

#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "live_config.h"
#include "live_recording.h"
#include "live_run.h"
#include "perch/station/station.h"

namespace perch {

// The ground station of a run: what the estimator says goes to it as it comes, how the run goes twice a
// second.
class LiveStation {
 public:
  // `source` is not open any more once the run has it: what the station wants of it is copied here.
  LiveStation(const LiveConfig& config, const OpenedSource& source);

  // From the estimator's thread, and the link's. Neither waits.
  void see(const Frame& frame, const Estimator::Aid& aid, const Estimate& estimate);
  void hear(const NavSample& sample);
  void tell_event(const std::string& what) { station_.tell_event(what); }

  // From the supervisor's thread, now and then: what the page says of the run, and what the page asked for.
  // What came of that is in the events it returns.
  std::vector<std::string> look_after(LiveRun& run, LiveRecording& recording);

  uint16_t port() const { return station_.port(); }
  nlohmann::ordered_json summary() const;

 private:
  std::optional<Rigid3> navigation_at(int64_t camera_time_ns);
  nlohmann::json status_of(LiveRun& run, LiveRecording& recording) const;

  const FrameChain frames_;
  const bool recorded_;
  const double ahead_;   // how long navigation is carried on, s
  std::mutex mutex_;     // of navigation_
  NavTrack navigation_;  // a replay's, all of it; an autopilot's, the last second
  int64_t told_ns_ = 0;
  Station station_;
};

}  // namespace perch
