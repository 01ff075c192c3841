#include "live_nmea.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "perch/geometry/euler.h"
#include "thread_cpu.h"

namespace perch {
namespace {

using namespace std::chrono_literals;

constexpr auto kTick = 10ms;
constexpr size_t kMostEvents = 100;
constexpr int64_t kRatesSettle = 5'000'000'000;
// Between fixes further apart than NavTrack::kMaxGap nothing is compared, and attitudes further apart than
// 0.2 s do not say where down is.
constexpr double kLeastFixHz = 2, kLeastAttitudeHz = 5;

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[200];
  std::snprintf(text, sizeof(text), pattern, values...);
  return text;
}

NavSample nav_sample_of(const nmea::PositionFix& fix) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  return {fix.time_ns,
          {fix.ned_from_body.value_or(Eigen::Quaterniond(kUnknown, kUnknown, kUnknown, kUnknown)),
           fix.body_in_ned},
          fix.body_velocity_in_ned};
}

}  // namespace

LiveNmea::LiveNmea(const LiveConfig& config, LinkTap tap)
    : tap_(std::move(tap)),
      time_offset_ns_(-navigation_time_ns(config.run.frames, 0)),
      begin_ns_(monotonic_ns()),
      stream_(*config.nav_url),
      receiver_(config.receiver),
      thread_([this] { run(); }) {}

LiveNmea::~LiveNmea() {
  stop_ = true;
  stream_.wake();
  thread_.join();
}

void LiveNmea::run() {
  while (!stop_) {
    stream_.run(kTick, [&](const Chunk& chunk) {
      const std::lock_guard lock(mutex_);
      receiver_.receive(chunk.bytes, chunk.arrival_ns);
    });
    std::vector<nmea::PositionFix> fixes;
    {
      const std::lock_guard lock(mutex_);
      fixes = receiver_.take_fixes(monotonic_ns());
      notice_changes(monotonic_ns());
    }
    if (tap_.navigation) {
      for (const nmea::PositionFix& fix : fixes) tap_.navigation(nav_sample_of(fix));
    }
    ++progress_;
    cpu_seconds_ = thread_cpu_seconds();
  }
}

Estimator::Aid LiveNmea::aid_at(int64_t camera_time_ns) {
  const std::lock_guard lock(mutex_);
  Estimator::Aid aid;
  aid.autopilot = receiver_.take_attitudes();
  for (AutopilotSample& sample : aid.autopilot) sample.timestamp_ns += time_offset_ns_;
  if (const auto attitude = receiver_.history().attitude_at(camera_time_ns - time_offset_ns_))
    aid.world_from_body = attitude->ned_from_body;
  return aid;
}

// With the mutex held, as all that follows.
void LiveNmea::notice_changes(int64_t now_ns) {
  const auto notice = [&](const std::string& event) {
    if (events_.size() < kMostEvents) events_.push_back(event);
  };
  if (const auto quality = receiver_.quality(now_ns); quality != told_quality_) {
    told_quality_ = quality;
    notice(status_at(now_ns));
  }
  if (const auto& frame = receiver_.frame(); frame && !told_origin_) {
    told_origin_ = true;
    notice(format("receiver: origin {latitude_deg: %.9f, longitude_deg: %.9f, height: %.3f}",
                  frame->origin().latitude * kDegFromRad, frame->origin().longitude * kDegFromRad,
                  frame->origin().height));
  }
  if (const uint64_t steps = receiver_.clock().steps(); steps != told_steps_) {
    told_steps_ = steps;
    notice("the receiver's clock was set: matched anew");
  }
}

std::string LiveNmea::status_at(int64_t now_ns) const {
  std::string text = std::string("receiver ") + name_of(receiver_.quality(now_ns));
  if (receiver_.quality(now_ns) == nmea::FixQuality::kNone) return text;
  text += format(", %d satellites", receiver_.satellites());
  if (const auto accuracy = receiver_.accuracy(now_ns))
    text += format(", %.2g m%s", accuracy->horizontal, accuracy->told ? "" : " by its HDOP");
  return text;
}

// In the words of the doctor, which examines autopilots.
std::vector<std::string> LiveNmea::findings(int64_t now_ns) const {
  std::vector<std::string> findings;
  if (const std::string problem = stream_.statistics().last_error;
      !stream_.statistics().open && !problem.empty())
    findings.push_back("error: " + problem);
  if (now_ns - begin_ns_ < kRatesSettle) return findings;
  const auto& s = receiver_.sentence_statistics();
  if (s.good == 0 && stream_.statistics().bytes_in > 0)
    findings.emplace_back("error: no NMEA sentence in what comes: look at the baud rate");
  const double fix_hz = receiver_.fix_hz(now_ns), attitude_hz = receiver_.attitude_hz(now_ns);
  if (s.good > 0 && fix_hz < kLeastFixHz)
    findings.push_back(
        format("warning: position rate is %.3g Hz: nothing is compared across gaps of more than 0.5 s: "
               "have it send GGA at 5 Hz or more",
               fix_hz));
  if (receiver_.statistics().attitudes > 0 && attitude_hz < kLeastAttitudeHz)
    findings.push_back(
        format("warning: attitude rate is %.3g Hz: between samples so far apart a turn is not known: "
               "have it send PASHR at 20 Hz or more",
               attitude_hz));
  return findings;
}

std::vector<std::string> LiveNmea::take_events() {
  const std::lock_guard lock(mutex_);
  return std::exchange(events_, {});
}

std::string LiveNmea::status() const {
  const std::lock_guard lock(mutex_);
  return status_at(monotonic_ns());
}

nlohmann::json LiveNmea::link_json() const {
  const std::lock_guard lock(mutex_);
  const int64_t now_ns = monotonic_ns();
  const auto lateness_ns = receiver_.clock().median_lateness_ns(now_ns);
  const bool heard = receiver_.fix_hz(now_ns) > 0 || receiver_.attitude_hz(now_ns) > 0;
  return {{"autopilot", "NMEA receiver"},
          {"heard", heard},
          {"text", status_at(now_ns)},
          {"attitude_hz", receiver_.attitude_hz(now_ns)},
          {"clock_ms",
           lateness_ns ? nlohmann::json(1e-6 * static_cast<double>(*lateness_ns)) : nlohmann::json(nullptr)},
          {"findings", findings(now_ns)}};
}

nlohmann::ordered_json LiveNmea::summary() const {
  using nlohmann::ordered_json;
  const StreamStatistics stream = stream_.statistics();
  const std::lock_guard lock(mutex_);
  const int64_t now_ns = monotonic_ns();
  const auto& s = receiver_.statistics();
  const auto& sentences = receiver_.sentence_statistics();
  ordered_json json;
  json["fix"] = name_of(receiver_.quality(now_ns));
  json["satellites"] = receiver_.satellites();
  const auto accuracy = receiver_.accuracy(now_ns);
  json["sigma_m"] = accuracy ? ordered_json{{"horizontal", accuracy->horizontal},
                                            {"vertical", accuracy->vertical},
                                            {"by", accuracy->told ? "GST" : "HDOP"}}
                             : ordered_json(nullptr);
  json["fix_hz"] = receiver_.fix_hz(now_ns);
  json["attitude_hz"] = receiver_.attitude_hz(now_ns);
  json["fixes"] = s.fixes;
  json["attitudes"] = s.attitudes;
  json["refused"] = {{"bad_checksum", sentences.bad_checksum},
                     {"broken", sentences.broken},
                     {"malformed", s.malformed},
                     {"no_fix", s.no_fix},
                     {"times", s.times_refused},
                     {"jumps", s.jumps_refused},
                     {"repeated", s.repeated}};
  json["clock"] = {{"steps", receiver_.clock().steps()}, {"median_lateness_us", nullptr}};
  if (const auto lateness_ns = receiver_.clock().median_lateness_ns(now_ns))
    json["clock"]["median_lateness_us"] = 1e-3 * static_cast<double>(*lateness_ns);
  if (const auto& frame = receiver_.frame()) {
    json["origin"] = {{"latitude_deg", frame->origin().latitude * kDegFromRad},
                      {"longitude_deg", frame->origin().longitude * kDegFromRad},
                      {"height", frame->origin().height}};
  }
  json["stream"] = {{"opened", stream.opened},
                    {"open_failed", stream.open_failed},
                    {"disconnected", stream.disconnected},
                    {"bytes_in", stream.bytes_in},
                    {"last_error", stream.last_error}};
  return json;
}

}  // namespace perch
