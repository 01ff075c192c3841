#include "flight_aids.h"

#include <cmath>

#include "perch/flight/head_angles.h"

namespace perch {

FlightAids::FlightAids(const Flight& flight, const FrameChain& chain, const RunConfig& config)
    : flight_(flight), chain_(chain), fuse_navigation_(config.tracking.fuse_navigation) {
  if (config.replay_aids == ReplayAids::kRecorded && RecordedAids::are_there(flight.folder)) {
    recorded_.emplace(flight.folder);
  }
}

Estimator::Aid FlightAids::at(int64_t camera_time_ns) {
  Estimator::Aid aid = recorded_ ? recorded_->at(camera_time_ns) : from_flight(camera_time_ns);
  ++frames_;
  headless_ += !knows_camera(chain_, aid.angles);
  return aid;
}

Estimator::Aid FlightAids::from_flight(int64_t camera_time_ns) {
  Estimator::Aid aid;
  if (const auto nav = flight_.nav.at(navigation_time_ns(chain_, camera_time_ns))) {
    if (nav->knows_attitude()) aid.world_from_body = nav->world_from_body.rotation;
  }
  const double latency = chain_.pan_tilt ? chain_.pan_tilt->latency : 0;
  if (const auto head = gimbal_at(flight_.gimbal, camera_time_ns + std::llround(1e9 * latency))) {
    aid.angles = HeadAngles{head->pan, head->tilt};
    aid.zoom = head->zoom;
  }
  if (fuse_navigation_) aid.autopilot = said_until(camera_time_ns);
  return aid;
}

// What the flight's navigation said up to a frame, as it would have come in a live run.
std::vector<AutopilotSample> FlightAids::said_until(int64_t camera_time_ns) {
  std::vector<AutopilotSample> said;
  const int64_t until_ns = navigation_time_ns(chain_, camera_time_ns);
  const auto& samples = flight_.nav.samples;
  for (; next_ < samples.size() && samples[next_].timestamp_ns <= until_ns; ++next_) {
    AutopilotSample sample;
    sample.timestamp_ns = camera_time_ns - (until_ns - samples[next_].timestamp_ns);
    if (samples[next_].knows_attitude()) sample.world_from_body = samples[next_].world_from_body.rotation;
    sample.body_velocity_in_world = samples[next_].body_velocity_in_world;
    said.push_back(sample);
  }
  return said;
}

std::vector<std::string> FlightAids::problems() const {
  auto problems = recorded_ ? recorded_->problems() : std::vector<std::string>{};
  if (headless_ > 0) {
    problems.push_back((flight_.folder / "mav0/gimbal0/data.csv").string() +
                       ": no angles of the pan/tilt head at " + std::to_string(headless_) + " of " +
                       std::to_string(frames_) +
                       " frames: where the camera looked is not known, so these have no pad_from_body");
  }
  return problems;
}

}  // namespace perch
