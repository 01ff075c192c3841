#include "live_run.h"

#include <glog/logging.h>

#include <cstring>
#include <utility>

#include "thread_cpu.h"

namespace perch {
namespace {

using namespace std::chrono_literals;

// How long a thread waits before it looks whether it is to end.
constexpr auto kWait = 100ms;

// FNV-1a over words of 8 bytes: whether two pictures are the same to the last bit.
uint64_t fingerprint(const cv::Mat& picture) {
  uint64_t hash = 1469598103934665603ULL;
  for (int row = 0; row < picture.rows; ++row) {
    const uint8_t* at = picture.ptr(row);
    const auto bytes = static_cast<size_t>(picture.cols) * picture.elemSize();
    for (size_t i = 0; i < bytes; i += sizeof(uint64_t)) {
      uint64_t word = 0;
      std::memcpy(&word, at + i, std::min(sizeof(word), bytes - i));
      hash = (hash ^ word) * 1099511628211ULL;
    }
  }
  return hash;
}

RunConfig with_mount_of(const LiveConfig& config, const OpenedSource& source) {
  RunConfig run = config.run;
  run.frames.body_from_base = body_from_base_of(config, source);
  return run;
}

// Of a recording that is read as fast as it can be no frame is left out.
NewestFrame::WhenFull when_full(const LiveConfig& config, const OpenedSource& source) {
  const bool every = source.pictures->recorded() && config.run.live.pace == Pace::kFast;
  return every ? NewestFrame::WhenFull::kWait : NewestFrame::WhenFull::kReplace;
}

}  // namespace

LiveRun::LiveRun(const LiveConfig& config, OpenedSource source, LinkTap tap, OnEstimate on_estimate)
    : source_(std::move(source)),
      recorded_(source_.pictures->recorded()),
      on_estimate_(std::move(on_estimate)),
      estimator_(with_mount_of(config, source_), source_.camera),
      slot_(when_full(config, source_)),
      watch_(config.run.tracking.coast) {
  if (config.nav == NavSource::kMavlink) {
    link_ = std::make_unique<LiveLink>(config, latency_, std::move(tap),
                                       with_mount_of(config, source_).frames, source_.camera);
  } else if (config.nav == NavSource::kNmea) {
    receiver_ = std::make_unique<LiveNmea>(config, std::move(tap));
  } else if (config.nav == NavSource::kFlight && source_.flight) {
    aids_ = std::make_unique<FlightAids>(*source_.flight, with_mount_of(config, source_).frames, config.run);
  }
  if (config.ptz && !config.ptz->gimbal) {
    ptz_ = std::make_unique<LivePtz>(*config.ptz, config.run, with_mount_of(config, source_).frames,
                                     source_.camera);
  }
  estimator_thread_ = std::thread([this] { guard([this] { estimate(); }); });
  capture_thread_ = std::thread([this] { guard([this] { capture(); }); });
}

LiveRun::~LiveRun() { stop(); }

void LiveRun::stop() {
  stop_ = true;
  slot_.close();
  if (capture_thread_.joinable()) capture_thread_.join();
  if (estimator_thread_.joinable()) estimator_thread_.join();
}

void LiveRun::guard(const std::function<void()>& work) {
  try {
    work();
  } catch (...) {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = std::current_exception();
    finished_ = true;
  }
}

void LiveRun::rethrow() const {
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

void LiveRun::capture() {
  uint64_t last = 0;
  while (!stop_ && !source_.pictures->ended()) {
    ++capture_progress_;
    capture_cpu_ = thread_cpu_seconds();
    const auto picture = source_.pictures->next(kWait);
    if (!picture) continue;
    // A camera or decoder that hangs may give its last picture again and again, with new times: a sensor's
    // noise never repeats itself. What was seen then must not pass for what is seen now.
    if (!recorded_ && !picture->frame.grey.empty()) {
      const uint64_t current = fingerprint(picture->frame.grey);
      if (current == last) {
        ++repeated_;
        continue;
      }
      last = current;
    }
    if (captured_++ == 0) {
      LOG(INFO) << "camera: first picture, " << picture->frame.name << ", " << picture->frame.grey.cols << "x"
                << picture->frame.grey.rows << ", exposed at " << picture->frame.timestamp_ns << " ns";
    }
    if (!slot_.put(*picture)) break;
  }
  slot_.close();
}

void LiveRun::estimate() {
  LiveFrame picture;
  while (!slot_.drained()) {
    ++estimator_progress_;
    estimator_cpu_ = thread_cpu_seconds();
    if (!slot_.take(picture, kWait)) continue;
    const int64_t taken_ns = monotonic_ns();
    const Estimator::Aid aid = aid_at(picture.frame.timestamp_ns);
    const Estimate estimate = estimator_.process(picture.frame, aid);
    latency_.add(LiveStage::kWaiting, taken_ns - picture.arrived_ns);
    latency_.add(LiveStage::kEstimate, monotonic_ns() - taken_ns);
    hand_on(picture, estimate);
    steer(estimate, aid);
    if (on_estimate_) on_estimate_(picture.frame, aid, estimate);
  }
  finished_ = true;
}

void LiveRun::steer(const Estimate& estimate, const Estimator::Aid& aid) {
  std::optional<HeadControl::Glimpse> glimpse;
  if (estimate.status == EstimateStatus::kOk)
    glimpse = {estimate.timestamp_ns, estimate.camera_from_target.mean.translation};
  if (ptz_) {
    ptz_->steer(estimate.state, aid.world_from_body, glimpse);
  } else if (link_) {
    link_->steer_gimbal(estimate.state, aid.world_from_body, glimpse);
  }
}

Estimator::Aid LiveRun::aid_at(int64_t camera_time_ns) {
  Estimator::Aid aid;
  if (link_) {
    aid = link_->aid_at(camera_time_ns);
  } else if (receiver_) {
    aid = receiver_->aid_at(camera_time_ns);
  } else if (aids_) {
    aid = aids_->at(camera_time_ns);
  }
  if (ptz_) {
    aid.angles = ptz_->angles_at(camera_time_ns);
    aid.zoom = ptz_->zoom();
  }
  return aid;
}

void LiveRun::hand_on(const LiveFrame& picture, const Estimate& estimate) {
  const int64_t now_ns = monotonic_ns();
  const bool believed = estimate.state && estimate.state->source == StateSource::kVision;
  if (link_) {
    link_->report({estimate.state, estimate.status == EstimateStatus::kOk && believed,
                   picture.frame.timestamp_ns, now_ns});
  } else {
    latency_.add(LiveStage::kTotal, now_ns - (recorded_ ? picture.arrived_ns : picture.frame.timestamp_ns));
  }
  if (!recorded_) latency_.add(LiveStage::kCamera, picture.arrived_ns - picture.frame.timestamp_ns);
  frames_.add(estimate.status);
  const std::lock_guard lock(mutex_);
  watch_.see(estimate.state, now_ns);
  last_state_ = estimate.state;
}

uint64_t LiveRun::progress() const {
  // The slowest of them: one that is stuck holds all up.
  uint64_t slowest = std::min(capture_progress_.load(), estimator_progress_.load());
  if (link_) slowest = std::min(slowest, link_->progress());
  if (receiver_) slowest = std::min(slowest, receiver_->progress());
  return slowest;
}

mavlink::PadState LiveRun::pad_state() const {
  const std::lock_guard lock(mutex_);
  return watch_.at(monotonic_ns());
}

nlohmann::json LiveRun::head_status() const {
  if (ptz_) return ptz_->status();
  return link_ ? link_->gimbal_status() : nlohmann::json();
}

std::string LiveRun::centre_head() {
  if (ptz_) {
    ptz_->centre();
  } else if (!link_ || !link_->centre_gimbal()) {
    return "centre: no pan/tilt head is driven";
  }
  return "centre: the head goes to its middle";
}

std::optional<VehicleState> LiveRun::last_state() const {
  const std::lock_guard lock(mutex_);
  return last_state_;
}

nlohmann::ordered_json LiveRun::summary() const {
  nlohmann::ordered_json json;
  json["frames"] = frames_.all();
  json["status"] = frames_.json();
  json["camera"] = camera_json(camera_counters());
  json["replaced"] = slot_.replaced();  // by a newer one before the estimator had time
  json["repeated"] = repeated_.load();
  json["latency_us"] = latency_json(latency_.all());
  json["cpu_s"] = {{"capture", capture_cpu_.load()}, {"estimator", estimator_cpu_.load()}};
  if (link_) {
    json["cpu_s"]["link"] = link_->cpu_seconds();
    json["mavlink"] = link_->summary();
  }
  if (receiver_) {
    json["cpu_s"]["link"] = receiver_->cpu_seconds();
    json["nmea"] = receiver_->summary();
  }
  if (ptz_) {
    json["cpu_s"]["ptz"] = ptz_->cpu_seconds();
    json["ptz"] = ptz_->summary();
  }
  if (aids_) json["problems"] = aids_->problems();
  return json;
}

}  // namespace perch
