#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "live_config.h"
#include "live_link.h"
#include "perch/estimator/estimator.h"
#include "perch/links/byte_stream.h"
#include "perch/links/nmea/receiver.h"

namespace perch {

// A receiver that tells where the vehicle is: a thread that hears it, and what the estimator asks of it. Its
// attitude, where it tells one, says where down is and is fused; its positions are recorded and shown.
class LiveNmea {
 public:
  LiveNmea(const LiveConfig& config, LinkTap tap);
  ~LiveNmea();  // ends the thread

  // What is known beside the picture at this frame's time, and what was said since the last one's.
  Estimator::Aid aid_at(int64_t camera_time_ns);

  // What happened since the last call, for the log and the recording: how good its fix is, its origin.
  std::vector<std::string> take_events();
  nlohmann::ordered_json summary() const;
  // "receiver RTK fixed, 14 satellites, 0.02 m"
  std::string status() const;
  // What the ground station's page shows of a link.
  nlohmann::json link_json() const;

  uint64_t progress() const { return progress_; }
  double cpu_seconds() const { return cpu_seconds_; }

 private:
  void run();
  void notice_changes(int64_t now_ns);
  std::string status_at(int64_t now_ns) const;
  std::vector<std::string> findings(int64_t now_ns) const;

  const LinkTap tap_;
  const int64_t time_offset_ns_;  // camera's clock minus ours, with what the receiver takes to speak
  const int64_t begin_ns_;
  ByteStream stream_;

  mutable std::mutex mutex_;  // guards what follows
  nmea::Receiver receiver_;
  std::vector<std::string> events_;
  nmea::FixQuality told_quality_ = nmea::FixQuality::kNone;
  bool told_origin_ = false;
  uint64_t told_steps_ = 0;

  std::atomic<uint64_t> progress_ = 0;
  std::atomic<double> cpu_seconds_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace perch
