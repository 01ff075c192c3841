#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "perch/camera/camera_model.h"
#include "perch/config/section.h"
#include "perch/links/byte_stream.h"
#include "perch/links/stream_url.h"
#include "perch/links/visca/visca_camera.h"
#include "perch/ptz/head_control.h"

namespace perch {

// The `ptz` section: the head that turns the camera (docs/PTZ.md).
struct PtzOptions {
  StreamUrl url;
  visca::ViscaOptions visca;
  HeadControlOptions control;
  bool follow = true;  // else its angles are read only
  double zoom = 0;  // told once it answers: the one that camera.model is of, or one within camera.zoom_table
};

// Empty without `ptz.device`. Throws ConfigError.
std::optional<PtzOptions> read_ptz_options(Section ptz);

// The head: a thread that speaks with it, and what the estimator's thread asks and tells. No call waits for
// the device.
class LivePtz {
 public:
  LivePtz(const PtzOptions& options, const FrameChain& chain, const CameraModel& camera);
  ~LivePtz();  // stops the head, ends the thread

  std::optional<HeadAngles> angles_at(int64_t time_ns) const;
  // As the camera tells it, once it is where it was told to go; empty before, and while somebody moves it,
  // but for the first 0.4 s.
  std::optional<double> zoom() const;
  // Where the vehicle is after a picture, and its attitude where that is known: the head follows.
  void report(const std::optional<VehicleState>& state,
              const std::optional<Eigen::Quaterniond>& world_from_body);

  uint64_t progress() const { return progress_; }
  double cpu_seconds() const { return cpu_seconds_; }
  nlohmann::ordered_json summary() const;

 private:
  void run();
  void turn();

  const PtzOptions options_;
  ByteStream stream_;

  mutable std::mutex mutex_;  // guards what follows
  visca::ViscaCamera head_;
  HeadControl control_;
  bool zoom_told_ = false;
  uint64_t moves_ = 0, searching_ = 0, blind_ = 0;

  std::atomic<uint64_t> progress_ = 0;
  std::atomic<double> cpu_seconds_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace perch
