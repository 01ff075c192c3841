#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "perch/config/section.h"
#include "perch/estimator/run_config.h"
#include "perch/links/stream_url.h"
#include "perch/links/visca/visca_camera.h"
#include "perch/ptz/head_control.h"
#include "perch/ptz/zoom_control.h"

namespace perch {

// The `ptz` section: the head that turns the camera (docs/PTZ.md).
struct PtzOptions {
  bool gimbal = false;  // the vehicle's, through its autopilot; else VISCA at url
  StreamUrl url;
  visca::ViscaOptions visca;
  HeadControlOptions control;
  bool follow = true;  // else its angles are read only
  double zoom = 0;  // told once it answers: the one that camera.model is of, or one within camera.zoom_table
  std::optional<double> fill;  // of the picture's smaller side, by the target; empty: the zoom stays
};

// Empty without `ptz.device`. Throws ConfigError.
std::optional<PtzOptions> read_ptz_options(Section ptz);

// What a head is told, whatever the wire to it: to follow the pad, to zoom, to go back to the middle. One
// thread at a time: its owner's lock.
class LiveHead {
 public:
  // `camera`: at ptz.zoom. `frames`: with body_from_base.
  LiveHead(const PtzOptions& options, const RunConfig& config, const FrameChain& frames,
           const CameraModel& camera, const HeadModel& model);

  // Where the vehicle is after a picture, and its attitude where that is known.
  void steer(int64_t now_ns, const std::optional<VehicleState>& state,
             const std::optional<Eigen::Quaterniond>& world_from_body,
             const std::optional<HeadControl::Glimpse>& glimpse, PtzCamera& head);
  // To its zero, at the zoom of the start; then it follows again.
  void centre(int64_t now_ns, PtzCamera& head);
  bool is_centring(int64_t now_ns) const { return now_ns < centring_until_ns_; }
  // What was told last.
  double zoom() const { return zoom_; }

  nlohmann::ordered_json summary() const;
  // For the ground station: deg, and null for what is not known.
  nlohmann::json status(int64_t now_ns, const PtzCamera& head) const;

 private:
  void zoom_to(double zoom, PtzCamera& head);

  const PtzOptions options_;
  const std::optional<ZoomTable> table_;
  HeadControl control_;
  std::optional<ZoomControl> zoom_control_;
  double zoom_;
  int64_t centring_until_ns_ = 0;
  int64_t blind_since_ns_ = 0;  // 0: it is not
  const char* doing_ = "rests";
  uint64_t moves_ = 0, searching_ = 0, blind_ = 0, zooms_ = 0;
};

}  // namespace perch
