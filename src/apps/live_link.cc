#include "live_link.h"

#include <chrono>
#include <utility>

#include "perch/frames/frame_chain.h"
#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/numbers.h"
#include "thread_cpu.h"

namespace perch {
namespace {

using namespace std::chrono_literals;
using mavlink::LinkState;

// A question about the time is answered within this, and asked as often as it has to be.
constexpr auto kTick = 5ms;
// A third of a second at 30 Hz; what is older is of no use.
constexpr size_t kMostReports = 10;
constexpr size_t kMostEvents = 100;

int64_t unix_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string autopilot_name(const mavlink::Autopilot& autopilot) {
  std::string name = "autopilot of MAV_AUTOPILOT ";
  if (autopilot.is_ardupilot()) {
    name = "ArduPilot";
  } else if (autopilot.is_px4()) {
    name = "PX4";
  } else {
    name += std::to_string(autopilot.autopilot);
  }
  if (autopilot.version) name.append(" ").append(version_text(*autopilot.version));
  return name + ", system " + std::to_string(autopilot.system);
}

const char* name_of(LinkState state) {
  constexpr const char* kNames[] = {"silent", "up", "lost"};
  return kNames[static_cast<size_t>(state)];
}

}  // namespace

LiveLink::LiveLink(const LiveConfig& config, LiveLatency& latency, LinkTap tap, const FrameChain& frames,
                   const CameraModel& camera)
    : latency_(latency),
      tap_(std::move(tap)),
      sends_(config.mavlink.send),
      frames_(config.run.frames),
      time_offset_ns_(-navigation_time_ns(config.run.frames, 0)),
      stream_(*config.nav_url),
      signing_(config.mavlink.signing ? std::make_unique<mavlink::Signing>(*config.mavlink.signing,
                                                                           mavlink::signing_time(unix_ns()))
                                      : nullptr),
      link_(config.mavlink.link, signing_.get()),
      output_(config.mavlink.landing),
      feed_(config.run.frames.time_offset),
      watch_(config.run.tracking.coast) {
  if (config.ptz && config.ptz->gimbal) {
    follows_ = config.ptz->follow;
    steering_.emplace(*config.ptz, config.run, frames, camera, mavlink::GimbalOptions{}.head);
    link_.listen([this](const mavlink::Frame& frame) { hear_for_gimbal(frame); });
  }
  thread_ = std::thread([this] { run(); });
}

LiveLink::~LiveLink() {
  if (steering_) {  // or it would turn on
    {
      const std::lock_guard lock(mutex_);
      if (gimbal_ && follows_) gimbal_->point({});
    }
    std::this_thread::sleep_for(100ms);
  }
  stop_ = true;
  stream_.wake();
  thread_.join();
}

void LiveLink::run() {
  while (!stop_) {
    hear();
    ++progress_;
    cpu_seconds_ = thread_cpu_seconds();
  }
}

void LiveLink::hear() {
  stream_.run(kTick, [&](const Chunk& chunk) {
    if (tap_.bytes) tap_.bytes(true, chunk.arrival_ns, chunk.bytes);
    const std::lock_guard lock(mutex_);
    link_.receive(chunk.bytes, chunk.arrival_ns, chunk.datagram);
  });
  const std::lock_guard lock(mutex_);
  const int64_t now_ns = monotonic_ns();
  if (signing_) signing_->advance(mavlink::signing_time(unix_ns()));
  send(link_.tick(now_ns), now_ns);
  while (!reports_.empty()) {
    const PadReport report = std::move(reports_.front());
    reports_.pop_front();
    tell(report);
  }
  tell_state(now_ns);
  tell_gimbal(now_ns);
  notice_changes();
  record_navigation();
}

void LiveLink::send(const std::vector<uint8_t>& bytes, int64_t now_ns) {
  if (bytes.empty() || !stream_.write(bytes) || !tap_.bytes) return;
  tap_.bytes(false, now_ns, bytes);
}

// With the mutex held, as all that follows: it is the estimator's thread that would wait, for microseconds.
void LiveLink::tell(const PadReport& report) {
  watch_.see(report.state, report.estimated_ns);
  if (!sends_ || !report.state) return;
  const int64_t capture_ns = report.camera_time_ns - time_offset_ns_;
  const auto sighting = mavlink::sighting_from(*report.state, capture_ns, report.trusted);
  const int64_t now_ns = monotonic_ns();
  const auto bytes = output_.bytes(sighting, link_, now_ns);
  if (bytes.empty()) return;
  send(bytes, now_ns);
  stream_.run(0ns, [&](const Chunk& chunk) {  // what was written goes out now
    if (tap_.bytes) tap_.bytes(true, chunk.arrival_ns, chunk.bytes);
    link_.receive(chunk.bytes, chunk.arrival_ns, chunk.datagram);
  });
  const int64_t out_ns = monotonic_ns();
  latency_.add(LiveStage::kOutput, out_ns - report.estimated_ns);
  latency_.add(LiveStage::kTotal, out_ns - capture_ns);
}

void LiveLink::tell_state(int64_t now_ns) {
  if (!sends_ || link_.state() != LinkState::kUp) return;
  if (const auto text = texts_.update(watch_.at(now_ns), now_ns)) {
    ++states_told_;
    send(link_.frame_of(*text), now_ns);
  }
}

void LiveLink::tell_gimbal(int64_t now_ns) {
  if (!steering_ || link_.state() != LinkState::kUp) return;
  if (!gimbal_) {
    mavlink::GimbalOptions options;
    options.system = options.our_system = link_.autopilot().system;
    options.our_component = link_.component();
    gimbal_.emplace(options, link_.history());
  }
  // One that is not to be moved is left to whoever moves it.
  if (!sends_ || !(follows_ || steering_->is_centring(now_ns))) return;
  const auto out = gimbal_->tick(now_ns);
  if (out.command) send(link_.frame_of(*out.command), now_ns);
  if (out.set) send(link_.frame_of(*out.set), now_ns);
}

void LiveLink::hear_for_gimbal(const mavlink::Frame& frame) {
  if (!gimbal_) return;
  if (const auto ack = mavlink::decode<mavlink::CommandAck>(frame)) gimbal_->receive(*ack);
  if (const auto status = mavlink::decode<mavlink::GimbalManagerStatus>(frame)) gimbal_->receive(*status);
}

void LiveLink::steer_gimbal(const std::optional<VehicleState>& state,
                            const std::optional<Eigen::Quaterniond>& world_from_body,
                            const std::optional<HeadControl::Glimpse>& glimpse) {
  const std::lock_guard lock(mutex_);
  if (gimbal_) steering_->steer(monotonic_ns(), state, world_from_body, glimpse, *gimbal_);
}

bool LiveLink::centre_gimbal() {
  const std::lock_guard lock(mutex_);
  if (gimbal_) steering_->centre(monotonic_ns(), *gimbal_);
  return gimbal_.has_value();
}

nlohmann::json LiveLink::gimbal_status() const {
  const std::lock_guard lock(mutex_);
  return gimbal_ ? steering_->status(monotonic_ns(), *gimbal_) : nlohmann::json();
}

void LiveLink::notice_changes() {
  const auto notice = [&](const std::string& event) {
    if (events_.size() < kMostEvents) events_.push_back(event);
  };
  if (link_.state() != told_state_) {
    told_state_ = link_.state();
    notice(std::string("link ") + name_of(told_state_) + ": " + autopilot_name(link_.autopilot()));
  }
  if (const auto profile = output_.profile(link_); sends_ && profile != told_profile_) {
    told_profile_ = profile;
    notice("profile " + std::string(name_of(profile)));
  }
  if (const uint64_t steps = link_.clock().statistics().steps; steps != told_steps_) {
    told_steps_ = steps;
    notice("the autopilot's clock was set: matched anew");
  }
  if (const bool clock = link_.clock().estimate(monotonic_ns()).has_value(); clock != told_clock_) {
    told_clock_ = clock;
    notice(clock ? "the autopilot's clock is matched" : "the autopilot's clock is not known any more");
  }
  for (const auto& text : link_.take_texts()) notice("autopilot: " + text.text);
}

// Once a position has an attitude on either side of it.
void LiveLink::record_navigation() {
  if (!tap_.navigation) return;
  const auto& motions = link_.history().motions();
  const auto* attitude = link_.history().attitudes().latest();
  size_t i = motions.size();
  while (i > 0 && motions[i - 1].time_ns > navigation_until_ns_) --i;
  for (; i < motions.size() && attitude && motions[i].time_ns <= attitude->time_ns; ++i) {
    navigation_until_ns_ = motions[i].time_ns;
    const auto at = link_.history().attitude_at(motions[i].time_ns);
    if (!at) continue;
    tap_.navigation(
        {motions[i].time_ns, {at->ned_from_body, motions[i].body_in_ned}, motions[i].body_velocity_in_ned});
  }
}

Estimator::Aid LiveLink::aid_at(int64_t camera_time_ns) {
  const std::lock_guard lock(mutex_);
  Estimator::Aid aid;
  aid.autopilot = feed_.take(link_.history());
  aid.world_from_body = feed_.attitude_at(link_.history(), camera_time_ns);
  if (frames_.pan_tilt) aid.angles = feed_.head_angles_at(link_.history(), frames_, camera_time_ns);
  return aid;
}

void LiveLink::report(const PadReport& report) {
  {
    const std::lock_guard lock(mutex_);
    if (reports_.size() >= kMostReports) {
      reports_.pop_front();
      ++reports_dropped_;
    }
    reports_.push_back(report);
  }
  stream_.wake();
}

std::vector<std::string> LiveLink::take_events() {
  const std::lock_guard lock(mutex_);
  return std::exchange(events_, {});
}

mavlink::VehicleSnapshot LiveLink::snapshot() const {
  const std::lock_guard lock(mutex_);
  auto snapshot = snapshot_of(link_, output_.profile(link_), monotonic_ns());
  snapshot.gimbal = frames_.pan_tilt.has_value();
  return snapshot;
}

bool LiveLink::settled() const {
  const std::lock_guard lock(mutex_);
  return link_.state() == LinkState::kUp && link_.parameters().complete() && link_.autopilot().version &&
         link_.clock().estimate(monotonic_ns());
}

std::string LiveLink::autopilot_text() const {
  const std::lock_guard lock(mutex_);
  return autopilot_name(link_.autopilot());
}

std::string LiveLink::status() const {
  const std::lock_guard lock(mutex_);
  std::string text = std::string("link ") + name_of(link_.state());
  if (sends_) text += std::string(", ") + std::to_string(output_.sent()) + " sent";
  return text;
}

nlohmann::ordered_json LiveLink::summary() const {
  using nlohmann::ordered_json;
  const StreamStatistics stream = stream_.statistics();
  const std::lock_guard lock(mutex_);
  const int64_t now_ns = monotonic_ns();
  ordered_json json;
  json["link"] = name_of(link_.state());
  if (link_.state() != LinkState::kSilent) json["autopilot"] = autopilot_name(link_.autopilot());
  json["profile"] = name_of(output_.profile(link_));
  json["sent"] = output_.sent();
  for (size_t i = 1; i < mavlink::kLandingRefusals; ++i) {
    const auto refusal = static_cast<mavlink::LandingRefusal>(i);
    json["refused"][std::string(name_of(refusal))] = output_.count(refusal);
  }
  if (steering_) {
    json["gimbal"] = {{"controlled", gimbal_ && gimbal_->ready()}};
    json["gimbal"].update(steering_->summary());
  }
  json["reports_dropped"] = reports_dropped_;
  json["states_told"] = states_told_;
  const auto& parsed = link_.parser_statistics();
  const auto& heard = link_.statistics();
  json["heard"] = {{"frames", parsed.good},
                   {"bad_crc", parsed.bad_crc},
                   {"unknown", parsed.unknown},
                   {"bad_signature", parsed.bad_signature + parsed.replayed + parsed.unsigned_refused},
                   {"skipped_bytes", parsed.skipped_bytes},
                   {"foreign", heard.foreign},
                   {"times_up", heard.times_up},
                   {"times_lost", heard.times_lost},
                   {"times_unknown", heard.times_unknown},
                   {"times_implausible", heard.times_implausible},
                   {"samples_refused", heard.samples_refused}};
  if (link_.asks_each()) {
    const auto& requests = link_.requests().statistics();
    json["requests"] = {
        {"asked", requests.asked},         {"answered", requests.answered},
        {"timed_out", requests.timed_out}, {"refused", requests.refused},
        {"unasked", requests.unasked},     {"times_by_round_trip", heard.times_by_round_trip}};
  }
  const auto& asked = link_.clock().statistics();
  json["clock"] = {{"asked", asked.asked},       {"heard", asked.heard}, {"answered", asked.answered},
                   {"outliers", asked.outliers}, {"steps", asked.steps}, {"sigma_us", nullptr},
                   {"round_trip_us", nullptr},   {"skew", nullptr}};
  if (const auto clock = link_.clock().estimate(now_ns)) {
    json["clock"]["sigma_us"] = static_cast<double>(clock->sigma_ns) * 1e-3;
    json["clock"]["round_trip_us"] = static_cast<double>(clock->min_round_trip_ns) * 1e-3;
    json["clock"]["skew"] = clock->skew;
  }
  json["stream"] = {{"opened", stream.opened},
                    {"open_failed", stream.open_failed},
                    {"disconnected", stream.disconnected},
                    {"bytes_in", stream.bytes_in},
                    {"bytes_out", stream.bytes_out},
                    {"writes_dropped", stream.writes_dropped},
                    {"last_error", stream.last_error}};
  return json;
}

}  // namespace perch
