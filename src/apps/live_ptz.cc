#include "live_ptz.h"

#include <chrono>
#include <cmath>

#include "thread_cpu.h"

namespace perch {
namespace {

using namespace std::chrono_literals;

// A packet's bytes take 5 to 16 ms at 9600 baud.
constexpr auto kTick = 2ms;

// Between where the zoom was told to go and where it says it is, of the whole way.
constexpr double kZoomThere = 0.01;

}  // namespace

LivePtz::LivePtz(const PtzOptions& options, const RunConfig& config, const FrameChain& frames,
                 const CameraModel& camera)
    : options_(options),
      latency_ns_(frames.pan_tilt ? std::llround(1e9 * frames.pan_tilt->latency) : 0),
      stream_(options.url),
      head_(options.visca),
      steering_(options, config, frames, camera, head_.model()),
      thread_([this] { run(); }) {}

LivePtz::~LivePtz() {
  if (options_.follow) {
    const std::lock_guard lock(mutex_);
    head_.point({});
  }
  // Half a second for the stop: a head that drives on would end at its stops.
  for (const int64_t until = monotonic_ns() + 500'000'000; monotonic_ns() < until && options_.follow;) {
    std::this_thread::sleep_for(10ms);
    const std::lock_guard lock(mutex_);
    if (!head_.ready() || !head_.busy()) break;
  }
  stop_ = true;
  stream_.wake();
  thread_.join();
}

void LivePtz::run() {
  while (!stop_) {
    turn();
    ++progress_;
    cpu_seconds_ = thread_cpu_seconds();
  }
}

void LivePtz::turn() {
  stream_.run(kTick, [&](const Chunk& chunk) {
    const std::lock_guard lock(mutex_);
    head_.receive(chunk.bytes, chunk.arrival_ns, chunk.datagram);
  });
  const std::lock_guard lock(mutex_);
  // A device that began anew is told anew.
  if (head_.ready() && !zoom_told_) head_.zoom_to(steering_.zoom());
  zoom_told_ = head_.ready();
  bool wrote = false;
  for (const visca::Bytes& packet : head_.tick(monotonic_ns())) wrote |= stream_.write(packet);
  if (wrote) stream_.wake();  // run() comes back at once, and has sent it
}

std::optional<HeadAngles> LivePtz::angles_at(int64_t camera_time_ns) const {
  const std::lock_guard lock(mutex_);
  return head_.at(camera_time_ns + latency_ns_);
}

std::optional<double> LivePtz::zoom() const {
  const std::lock_guard lock(mutex_);
  const auto zoom = head_.zoom();
  return zoom && std::abs(*zoom - steering_.zoom()) < kZoomThere ? zoom : std::nullopt;
}

void LivePtz::steer(const std::optional<VehicleState>& state,
                    const std::optional<Eigen::Quaterniond>& world_from_body,
                    const std::optional<HeadControl::Glimpse>& glimpse) {
  const std::lock_guard lock(mutex_);
  steering_.steer(monotonic_ns(), state, world_from_body, glimpse, head_);
}

void LivePtz::centre() {
  const std::lock_guard lock(mutex_);
  steering_.centre(monotonic_ns(), head_);
}

nlohmann::json LivePtz::status() const {
  const std::lock_guard lock(mutex_);
  return steering_.status(monotonic_ns(), head_);
}

nlohmann::ordered_json LivePtz::summary() const {
  const StreamStatistics stream = stream_.statistics();
  const std::lock_guard lock(mutex_);
  const auto& s = head_.statistics();
  nlohmann::ordered_json json = {{"ready", head_.ready()}, {"reaction_s", head_.reaction()}};
  json.update(steering_.summary());
  json.update({{"starts", s.starts},
               {"inquiries", s.inquiries},
               {"positions", s.positions},
               {"positions_doubted", s.positions_doubted},
               {"positions_refused", s.positions_refused},
               {"commands", s.commands},
               {"acks", s.acks},
               {"completions", s.completions},
               {"errors", s.errors},
               {"time_outs", s.time_outs},
               {"garbled", s.garbled},
               {"bytes_in", stream.bytes_in},
               {"bytes_out", stream.bytes_out},
               {"last_error", stream.last_error}});
  return json;
}

}  // namespace perch
