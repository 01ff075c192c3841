#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <vector>

#include "perch/camera/live_clock.h"
#include "perch/camera/live_source.h"
#include "perch/camera/live_tally.h"
#include "perch/simulation/head_feed.h"
#include "perch/simulation/simulation.h"

namespace perch {

// A simulated landing as it happens: a camera that sees it, and an autopilot that tells of it.
//
// In real time the flight begins when this is made, and stamps are on CLOCK_MONOTONIC. Each picture is
// rendered (20 to 30 ms at 640x480) before its time and given out when its exposure and readout would be
// over; a machine too slow for the rate leaves pictures out, counted as dropped. As fast as possible,
// pictures and stamps are those that perch-simulate writes, none left out; recorded() is then true. With a
// head that turns the camera a picture is rendered after its exposure, in real time alone: ConfigError
// otherwise.
//
// One thread calls next(), any other the rest.
class LiveSimulation : public LiveSource {
 public:
  explicit LiveSimulation(const Simulation& simulation, Pace pace = Pace::kRealTime,
                          LiveClock& clock = monotonic_clock());

  std::optional<LiveFrame> next(std::chrono::nanoseconds timeout) override;
  bool ended() const override { return ended_; }
  bool recorded() const override { return pace_ == Pace::kFast; }
  LiveCounters counters() const override { return tally_.counters(); }

  // What is so at a time on the pictures' clock, before and after the flight, too.
  VehicleTruth vehicle(int64_t time_ns) const { return flight_.vehicle_at(seconds(time_ns)); }
  PadTruth pad(int64_t time_ns) const { return flight_.pad_at(seconds(time_ns)); }
  Eigen::Vector3d angular_velocity_in_body(
      int64_t time_ns) const;  // of the body in the world, its axes, rad/s
  // What the navigation source says of that time, with the errors of its configured kind: they change at its
  // rate. The stamp is on the navigation source's clock.
  NavigationReport navigation(int64_t time_ns) const;

  const SimulatedFlight& flight() const { return flight_; }
  int64_t stamp_ns(int64_t frame) const;  // of a frame of the flight, on the pictures' clock

 private:
  struct NavigationError {
    int64_t since_start_ns = 0;
    Eigen::Vector3d position, rotation, velocity;
  };

  double seconds(int64_t time_ns) const { return static_cast<double>(time_ns - stamp_ns(0)) * 1e-9; }
  int64_t due_ns(int64_t frame) const { return stamp_ns(frame) + exposed_ns_; }
  void render();
  const SimulatedFlight& flight_at(double zoom);

  SimulatedFlight flight_;
  Pace pace_;
  LiveClock& clock_;
  LiveTally tally_;
  int64_t clock_offset_ns_ = 0;          // the pictures' clock less the flight's own
  int64_t exposed_ns_ = 0;               // from the middle of the exposure to the end of the readout
  std::vector<NavigationError> errors_;  // in the order of their times
  int64_t frame_ = 0;                    // the next one
  std::unique_ptr<HeadFeed> head_;       // where the camera turns
  double zoom_ = 0;
  std::unique_ptr<SimulatedFlight> zoomed_;  // the same through the lens at zoom_, but for the widest
  std::optional<Frame> picture_;             // of frame_, once it is rendered
  double cost_ns_ = 0;                       // of rendering a picture, smoothed
  std::atomic<bool> ended_ = false;
};

// What `sim:FILE.yaml` names. Throws ConfigError.
std::unique_ptr<LiveSimulation> open_live_simulation(const std::filesystem::path& file,
                                                     const LiveOptions& options = {});

}  // namespace perch
