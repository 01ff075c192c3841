#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "live_config.h"
#include "live_head.h"
#include "live_latency.h"
#include "perch/estimator/estimator.h"
#include "perch/flight/nav_track.h"
#include "perch/links/byte_stream.h"
#include "perch/links/mavlink/autopilot_feed.h"
#include "perch/links/mavlink/doctor.h"
#include "perch/links/mavlink/gimbal_camera.h"
#include "perch/links/mavlink/landing_output.h"
#include "perch/links/mavlink/pad_watch.h"
#include "perch/links/mavlink/vehicle_link.h"

namespace perch {

// What the estimator said of a frame, for the autopilot.
struct PadReport {
  std::optional<VehicleState> state;
  bool trusted = false;        // a pose of this frame's picture, believed by the filter
  int64_t camera_time_ns = 0;  // exposure
  int64_t estimated_ns = 0;    // CLOCK_MONOTONIC
};

// What a recording wants of the link; either may be empty. Called by the link's thread, and must not wait.
struct LinkTap {
  std::function<void(bool incoming, int64_t monotonic_ns, std::span<const uint8_t>)> bytes;
  std::function<void(const NavSample&)> navigation;
};

// The autopilot: a thread that hears it and tells it, and the two questions the estimator has for it.
class LiveLink {
 public:
  // `latency` must outlive the link. `frames` and `camera`: for a gimbal, as of LiveHead.
  LiveLink(const LiveConfig& config, LiveLatency& latency, LinkTap tap, const FrameChain& frames,
           const CameraModel& camera);
  ~LiveLink();  // ends the thread

  // What is known beside the picture at this frame's time, and what was said since the last one's.
  Estimator::Aid aid_at(int64_t camera_time_ns);
  // Never waits: what the link does not get rid of is dropped, the oldest first, and counted.
  void report(const PadReport& report);

  // With `ptz.device: mavlink`: the vehicle's gimbal, which is told what to do by and by.
  void steer_gimbal(const std::optional<VehicleState>& state,
                    const std::optional<Eigen::Quaterniond>& world_from_body,
                    const std::optional<HeadControl::Glimpse>& glimpse);
  bool centre_gimbal();                  // false without one
  nlohmann::json gimbal_status() const;  // null without one

  // What happened since the last call, for the log and the recording: the autopilot's texts, the link's
  // state.
  std::vector<std::string> take_events();
  mavlink::VehicleSnapshot snapshot() const;
  nlohmann::ordered_json summary() const;
  // "link up, 298 sent"
  std::string status() const;
  // "ArduPilot 4.6.0, system 1"
  std::string autopilot_text() const;
  // Everything that a check looks at has been asked for and has come, or will not come.
  bool settled() const;
  std::string connection_problem() const { return stream_.statistics().last_error; }

  uint64_t progress() const { return progress_; }
  double cpu_seconds() const { return cpu_seconds_; }

 private:
  void run();
  void hear();
  void tell(const PadReport& report);
  void tell_state(int64_t now_ns);
  void tell_gimbal(int64_t now_ns);
  void hear_for_gimbal(const mavlink::Frame& frame);
  void notice_changes();
  void record_navigation();
  void send(const std::vector<uint8_t>& bytes, int64_t now_ns);

  LiveLatency& latency_;
  const LinkTap tap_;
  const bool sends_;
  bool follows_ = false;  // with the gimbal
  const FrameChain frames_;
  const int64_t time_offset_ns_;
  ByteStream stream_;

  mutable std::mutex mutex_;  // guards what follows
  std::unique_ptr<mavlink::Signing> signing_;
  mavlink::VehicleLink link_;
  mavlink::LandingOutput output_;
  mavlink::AutopilotFeed feed_;
  mavlink::PadWatch watch_;
  mavlink::StateTexts texts_;
  std::optional<LiveHead> steering_;             // of the gimbal
  std::optional<mavlink::GimbalCamera> gimbal_;  // once the vehicle is known
  std::deque<PadReport> reports_;
  uint64_t reports_dropped_ = 0, states_told_ = 0;
  std::vector<std::string> events_;
  mavlink::LinkState told_state_ = mavlink::LinkState::kSilent;
  mavlink::LandingProfile told_profile_ = mavlink::LandingProfile::kNone;
  uint64_t told_steps_ = 0;
  bool told_clock_ = false;
  int64_t navigation_until_ns_ = 0;

  std::atomic<uint64_t> progress_ = 0;
  std::atomic<double> cpu_seconds_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace perch
