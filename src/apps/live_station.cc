#include "live_station.h"

#include <algorithm>

#include "perch/frames/frame_chain.h"
#include "perch/links/byte_stream.h"
#include "perch/links/mavlink/doctor.h"
#include "perch/links/mavlink/state_texts.h"

namespace perch {
namespace {

constexpr int64_t kTellEvery = 500'000'000;
constexpr int64_t kNavigationKept = 1'000'000'000;
// A receiver tells its position a tenth of a second late and at 5 to 10 Hz: what is shown is where it leads.
// At 2 m/s^2 that is off by 9 cm after 0.3 s, less than most receivers are.
constexpr double kReceiverAhead = 0.3;  // s
constexpr size_t kMostFindings = 12;

FrameChain with_mount(const LiveConfig& config, const OpenedSource& source) {
  FrameChain frames = config.run.frames;
  frames.body_from_base = body_from_base_of(config, source);
  return frames;
}

StationScene scene_of(const LiveConfig& config, const OpenedSource& source) {
  return {config.run.target, source.camera, with_mount(config, source), config.run.source,
          source.pictures->recorded()};
}

nlohmann::json link_json(LiveLink& link) {
  const mavlink::VehicleSnapshot snapshot = link.snapshot();
  nlohmann::json json = {{"autopilot", snapshot.heard ? link.autopilot_text() : ""},
                         {"heard", snapshot.heard},
                         {"text", link.status()},
                         {"attitude_hz", snapshot.attitude_hz},
                         {"clock_ms", nullptr},
                         {"findings", nlohmann::json::array()}};
  if (snapshot.clock) json["clock_ms"] = 1e-6 * static_cast<double>(snapshot.clock->sigma_ns);
  if (!snapshot.heard) return json;
  for (const mavlink::Finding& finding : mavlink::examine(snapshot)) {
    if (json["findings"].size() < kMostFindings) json["findings"].push_back(to_text(finding));
  }
  return json;
}

}  // namespace

LiveStation::LiveStation(const LiveConfig& config, const OpenedSource& source)
    : frames_(with_mount(config, source)),
      recorded_(source.pictures->recorded()),
      ahead_(config.nav == NavSource::kNmea ? kReceiverAhead : NavTrack::kMaxExtrapolation),
      navigation_(source.flight ? source.flight->nav : NavTrack{}),
      station_(config.station, scene_of(config, source)) {}

void LiveStation::hear(const NavSample& sample) {
  const std::lock_guard lock(mutex_);
  auto& samples = navigation_.samples;
  if (!samples.empty() && samples.back().timestamp_ns >= sample.timestamp_ns) return;
  samples.push_back(sample);
  const auto kept = std::find_if(samples.begin(), samples.end(), [&](const NavSample& s) {
    return s.timestamp_ns >= sample.timestamp_ns - kNavigationKept;
  });
  // Not one by one: a vector moves all that stays.
  if (kept - samples.begin() > 100) samples.erase(samples.begin(), kept);
}

std::optional<Rigid3> LiveStation::navigation_at(int64_t camera_time_ns) {
  if (!frames_.world_from_pad) return std::nullopt;
  const std::lock_guard lock(mutex_);
  const auto sample = navigation_.at(navigation_time_ns(frames_, camera_time_ns), ahead_);
  return sample ? pad_from_body_by_navigation(frames_, sample->world_from_body) : std::nullopt;
}

void LiveStation::see(const Frame& frame, const Estimator::Aid& aid, const Estimate& estimate) {
  std::optional<double> latency_ms;
  if (!recorded_) latency_ms = 1e-6 * static_cast<double>(monotonic_ns() - frame.timestamp_ns);
  station_.post(state_row(estimate, aid, navigation_at(frame.timestamp_ns), latency_ms));
  if (station_.wants_picture())
    station_.post(std::make_shared<const SeenPicture>(SeenPicture{frame.grey.clone(), estimate}));
}

nlohmann::json LiveStation::status_of(LiveRun& run, LiveRecording& recording) const {
  const LiveCounters camera = run.camera_counters();
  nlohmann::json status = {
      {"pad", mavlink::name_of(run.pad_state())},
      {"frames", run.frames().all()},
      {"counts", run.frames().json()},
      {"camera",
       {{"dropped", camera.dropped}, {"reopened", camera.reopened}, {"problem", camera.last_problem}}},
      {"recording", recording.status()},
      {"watching", station_.counts().watching},
      {"head", run.head_status()},
      {"link", nullptr}};
  if (run.link()) status["link"] = link_json(*run.link());
  if (run.receiver()) status["link"] = run.receiver()->link_json();
  return status;
}

std::vector<std::string> LiveStation::look_after(LiveRun& run, LiveRecording& recording) {
  std::vector<std::string> events;
  for (const StationCommand& command : station_.take_commands()) {
    switch (command.kind) {
      case StationCommand::Kind::kStartRecording:
        events.push_back(recording.start());
        break;
      case StationCommand::Kind::kStopRecording:
        events.push_back(recording.stop());
        break;
      case StationCommand::Kind::kMark:
        events.push_back("mark: " + mavlink::printable(command.text));
        break;
      case StationCommand::Kind::kCentreHead:
        events.push_back(run.centre_head());
        break;
    }
  }
  if (const int64_t now_ns = monotonic_ns(); now_ns - told_ns_ >= kTellEvery) {
    told_ns_ = now_ns;
    if (station_.counts().watching > 0) station_.tell_status(status_of(run, recording));
  }
  return events;
}

nlohmann::ordered_json LiveStation::summary() const {
  const StationCounts counts = station_.counts();
  return {{"bytes_out", counts.bytes_out},
          {"refused", counts.refused},
          {"rows_lost", counts.rows_lost},
          {"cpu_s", station_.cpu_seconds()}};
}

}  // namespace perch
