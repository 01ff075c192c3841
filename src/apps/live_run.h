#pragma once

#include <atomic>
#include <exception>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "flight_aids.h"
#include "live_link.h"
#include "live_nmea.h"
#include "live_ptz.h"
#include "live_report.h"
#include "live_source_of.h"
#include "newest_frame.h"

namespace perch {

// The loop: capture -> newest frame -> estimator -> outputs, each on its own thread.
//
//   capture thread    waits for the camera, copies the picture into the slot
//   estimator thread  asks the link what the autopilot knows, estimates, hands the result on
//   link thread       hears and tells the autopilot (LiveLink)
//
// and those of the recording. Nobody after the estimator can make it wait.
class LiveRun {
 public:
  // Hears each frame with what was known beside it and what the estimator said; must not wait, but in a
  // replay.
  using OnEstimate = std::function<void(const Frame&, const Estimator::Aid&, const Estimate&)>;

  LiveRun(const LiveConfig& config, OpenedSource source, LinkTap tap, OnEstimate on_estimate);
  // Ends every thread; what was taken in is estimated and told.
  ~LiveRun();

  void stop();
  // A recording is at its end, or something failed.
  bool finished() const { return finished_; }
  // Throws what ended a thread, if anything did.
  void rethrow() const;

  // Counts on while all threads go on.
  uint64_t progress() const;
  mavlink::PadState pad_state() const;
  // Null without a head that is moved. What was done, in a sentence.
  nlohmann::json head_status() const;
  std::string centre_head();
  LiveLink* link() { return link_.get(); }          // null without an autopilot
  LiveNmea* receiver() { return receiver_.get(); }  // null without one
  // Of the last frame; empty before the first pose.
  std::optional<VehicleState> last_state() const;
  LiveLatency& latency() { return latency_; }
  const FrameCounts& frames() const { return frames_; }
  LiveCounters camera_counters() const { return source_.pictures->counters(); }
  nlohmann::ordered_json summary() const;

 private:
  void capture();
  void estimate();
  void steer(const Estimate& estimate, const Estimator::Aid& aid);
  Estimator::Aid aid_at(int64_t camera_time_ns);
  void hand_on(const LiveFrame& picture, const Estimate& estimate);
  void guard(const std::function<void()>& work);

  OpenedSource source_;
  const bool recorded_;  // the stamps are of another day
  const OnEstimate on_estimate_;
  LiveLatency latency_;
  FrameCounts frames_;
  Estimator estimator_;
  NewestFrame slot_;
  std::unique_ptr<LiveLink> link_;
  std::unique_ptr<LiveNmea> receiver_;
  std::unique_ptr<FlightAids> aids_;
  std::unique_ptr<LivePtz> ptz_;

  mutable std::mutex mutex_;  // guards what follows
  mavlink::PadWatch watch_;
  std::optional<VehicleState> last_state_;
  std::exception_ptr failure_;

  std::atomic<uint64_t> captured_ = 0, repeated_ = 0, capture_progress_ = 0, estimator_progress_ = 0;
  std::atomic<double> capture_cpu_ = 0, estimator_cpu_ = 0;
  std::atomic<bool> stop_ = false, finished_ = false;
  std::thread estimator_thread_, capture_thread_;
};

}  // namespace perch
