#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "live_head.h"
#include "perch/links/byte_stream.h"

namespace perch {

// A VISCA camera: a thread that speaks with it, and what the estimator's thread asks and tells. No call waits
// for the device.
class LivePtz {
 public:
  // As LiveHead.
  LivePtz(const PtzOptions& options, const RunConfig& config, const FrameChain& frames,
          const CameraModel& camera);
  ~LivePtz();  // stops the head, ends the thread

  std::optional<HeadAngles> angles_at(int64_t camera_time_ns) const;
  // As the camera tells it, once it is where it was told to go; empty before, and while somebody moves it,
  // but for the first 0.4 s.
  std::optional<double> zoom() const;
  // Where the vehicle is after a picture, and its attitude where that is known: the head follows.
  void steer(const std::optional<VehicleState>& state,
             const std::optional<Eigen::Quaterniond>& world_from_body,
             const std::optional<HeadControl::Glimpse>& glimpse);
  void centre();
  nlohmann::json status() const;

  uint64_t progress() const { return progress_; }
  double cpu_seconds() const { return cpu_seconds_; }
  nlohmann::ordered_json summary() const;

 private:
  void run();
  void turn();

  const PtzOptions options_;
  const int64_t latency_ns_;  // of a reading
  ByteStream stream_;

  mutable std::mutex mutex_;  // guards what follows
  visca::ViscaCamera head_;
  LiveHead steering_;
  bool zoom_told_ = false;

  std::atomic<uint64_t> progress_ = 0;
  std::atomic<double> cpu_seconds_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace perch
