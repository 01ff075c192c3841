#include "live_supervisor.h"

#include <glog/logging.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>

#include "live_recording.h"
#include "live_run.h"
#include "live_station.h"
#include "perch/config/atomic_file.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/flight_recorder.h"
#include "perch/links/byte_stream.h"
#include "perch/links/service_manager.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kLook = 50ms;
constexpr int64_t kLogEvery = 10'000'000'000;

// Estimates as they come, as perch-batch writes them: whole files, or none.
class EstimateFiles {
 public:
  explicit EstimateFiles(const fs::path& folder) : folder_(made(folder)) {
    estimates_.append(estimates_header());
    states_.append(states_header());
  }
  void add(const Estimate& estimate) {
    row_.clear();
    append_estimate(estimate, row_);
    estimates_.append(row_);
    row_.clear();
    if (estimate.state) append_state(*estimate.state, row_);
    states_.append(row_);
  }
  void commit() {
    estimates_.commit();
    states_.commit();
  }

 private:
  static const fs::path& made(const fs::path& folder) {
    fs::create_directories(folder);
    return folder;
  }
  fs::path folder_;
  AtomicFile estimates_{folder_ / "estimates.csv"}, states_{folder_ / "states.csv"};
  std::string row_;
};

// frames.body_from_base for --set: where the source knew the mount, the recorded configuration has to say it.
std::string mount_override(const Rigid3& body_from_base) {
  const auto& p = body_from_base.translation;
  const Eigen::Quaterniond q = positive_w(body_from_base.rotation);
  char text[320];
  std::snprintf(text, sizeof(text),
                "frames.body_from_base={position: [%.17g, %.17g, %.17g], rotation: {quaternion_wxyz: "
                "[%.17g, %.17g, %.17g, %.17g]}}",
                p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z());
  return text;
}

double process_cpu_seconds() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

double peak_memory_bytes() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return 1024.0 * static_cast<double>(used.ru_maxrss);
}

// The configuration, and what it opens, in the order in which one depends on the other.
struct Opened {
  LiveConfig config;
  std::string resolved;
  OpenedSource source;
};

Opened open(const fs::path& file, std::vector<std::string> overrides) {
  LiveConfig config = read_live_config(Section::load(file, overrides));
  OpenedSource source = open_source_of(config);
  const auto mount = body_from_base_of(config, source);
  if (mount && !config.run.frames.body_from_base) {
    overrides.push_back(mount_override(*mount));
  } else if (!mount && config.mavlink.send) {
    throw ConfigError(file.string() +
                      ": frames.body_from_base: expected where the camera sits on the vehicle, as the pad's "
                      "place is sent in the vehicle's axes");
  }
  const Section root = Section::load(file, overrides);
  config = read_live_config(root);
  return {config, root.resolved(), std::move(source)};
}

// What makes a recorder of this run; empty: nothing is to be recorded.
LiveRecording::Make recorder_maker(const Opened& opened) {
  if (opened.config.record.empty()) return {};
  RecorderOptions options;
  options.folder = opened.config.record;
  options.format = opened.config.record_format;
  const auto& frames = opened.config.run.frames;
  std::optional<Rigid3> body_from_camera;
  if (frames.body_from_base && !frames.pan_tilt)
    body_from_camera = *frames.body_from_base * base_from_camera(frames, HeadAngles{});
  const double rate_hz = opened.config.run.live.rate_hz > 0 ? opened.config.run.live.rate_hz : 30;
  return [=, camera = opened.source.camera, resolved = opened.resolved] {
    return std::make_unique<FlightRecorder>(options, camera, resolved, body_from_camera, rate_hz);
  };
}

LinkTap tap_of(LiveRecording& recording, LiveStation* station) {
  using Direction = FlightRecorder::Direction;
  return {[&recording](bool incoming, int64_t ns, std::span<const uint8_t> bytes) {
            if (const auto recorder = recording.recorder())
              recorder->add_bytes(incoming ? Direction::kIn : Direction::kOut, ns, bytes);
          },
          [&recording, station](const NavSample& sample) {
            if (const auto recorder = recording.recorder()) recorder->add_navigation(sample);
            if (station) station->hear(sample);
          }};
}

nlohmann::ordered_json recording_json(const FlightRecorder& recorder) {
  const auto counters = recorder.counters();
  return {{"folder", recorder.folder().string()},      {"frames_written", counters.frames_written},
          {"frames_dropped", counters.frames_dropped}, {"rows_dropped", counters.rows_dropped},
          {"bytes_dropped", counters.bytes_dropped},   {"last_problem", counters.last_problem}};
}

// The program's log, as it is on stderr, into the recording.
class RecordedLog : public google::LogSink {
 public:
  explicit RecordedLog(const LiveRecording& recording) : recording_(recording) { google::AddLogSink(this); }
  ~RecordedLog() override { google::RemoveLogSink(this); }
  void send(google::LogSeverity severity, const char*, const char* file, int line,
            const google::LogMessageTime& time, const char* message, size_t length) override {
    if (const auto recorder = recording_.recorder()) {
      recorder->add_log(ToString(severity, file, line, time, message, length));
    }
  }

 private:
  const LiveRecording& recording_;
};

// Looks after a run: what changes is said once, how it goes every 10 s.
class Supervisor {
 public:
  Supervisor(LiveRun& run, LiveRecording& recording, LiveStation* station, const Supervision& supervision)
      : run_(run),
        recording_(recording),
        station_(station),
        supervision_(supervision),
        begin_ns_(monotonic_ns()) {}

  void watch() {
    manager_.ready(std::string(name_of(told_state_)));
    while (!supervision_.stop && !run_.finished() && !over()) {
      std::this_thread::sleep_for(kLook);
      say_changes();
      if (station_) {
        for (const std::string& what : station_->look_after(run_, recording_)) event(what);
      }
      feed_watchdog();
      if (monotonic_ns() - last_log_ns_ > kLogEvery) say_how_it_goes();
    }
    manager_.stopping();
    say_changes();
  }

  double seconds() const { return 1e-9 * static_cast<double>(monotonic_ns() - begin_ns_); }

 private:
  bool over() const { return supervision_.duration > 0 && seconds() >= supervision_.duration; }

  void event(const std::string& what) {
    LOG(INFO) << what;
    if (const auto recorder = recording_.recorder()) recorder->add_event(monotonic_ns(), what);
    if (station_) station_->tell_event(what);
  }

  void say_changes() {
    if (const auto state = run_.pad_state(); state != told_state_) {
      told_state_ = state;
      event("pad " + std::string(name_of(state)));
      manager_.status(std::string(name_of(state)));
    }
    if (run_.link()) {
      for (const std::string& what : run_.link()->take_events()) event(what);
    }
    if (run_.receiver()) {
      for (const std::string& what : run_.receiver()->take_events()) event(what);
    }
    if (const std::string problem = run_.camera_counters().last_problem; problem != told_problem_) {
      told_problem_ = problem;
      if (!problem.empty()) event("camera: " + problem);
    }
    // The first alone: of a full disk each picture tells anew. How many it costs is said every 10 s.
    if (const auto recorder = recording_.recorder(); recorder && !told_recording_) {
      const std::string problem = recorder->counters().last_problem;
      told_recording_ = !problem.empty();
      if (told_recording_) LOG(WARNING) << "recording: " << problem;
    }
    if (supervision_.reload.exchange(false))
      event("SIGHUP: nothing is reloaded; a changed configuration needs a restart");
  }

  void feed_watchdog() {
    const uint64_t progress = run_.progress();
    const int64_t now_ns = monotonic_ns();
    // Four signs of life a period: one that comes late is not the end.
    if (!manager_.watchdog() || progress == fed_progress_) return;
    if (now_ns - fed_ns_ < std::chrono::nanoseconds(*manager_.watchdog()).count() / 4) return;
    manager_.alive();
    fed_progress_ = progress;
    fed_ns_ = now_ns;
  }

  void say_how_it_goes() {
    last_log_ns_ = monotonic_ns();
    std::string line = "pad " + std::string(name_of(told_state_)) + ", " +
                       std::to_string(run_.frames().of(EstimateStatus::kOk)) + " of " +
                       std::to_string(run_.frames().all()) + " frames with a pose";
    if (run_.link()) line += "; " + run_.link()->status();
    if (run_.receiver()) line += "; " + run_.receiver()->status();
    if (const auto recorder = recording_.recorder()) {
      const auto counters = recorder->counters();
      line += "; recorded " + std::to_string(counters.frames_written) + ", dropped " +
              std::to_string(counters.frames_dropped);
    }
    const std::string latency = latency_text(run_.latency().take_recent());
    LOG(INFO) << line << (latency.empty() ? "" : "; ") << latency;
  }

  LiveRun& run_;
  LiveRecording& recording_;
  LiveStation* station_;
  const Supervision& supervision_;
  ServiceManager manager_;
  const int64_t begin_ns_;
  int64_t last_log_ns_ = begin_ns_;
  mavlink::PadState told_state_ = mavlink::PadState::kSearch;
  std::string told_problem_;
  bool told_recording_ = false;
  uint64_t fed_progress_ = 0;
  int64_t fed_ns_ = 0;
};

}  // namespace

int supervise(const fs::path& file, const std::vector<std::string>& overrides,
              const Supervision& supervision) {
  Opened opened = open(file, overrides);
  LiveRecording recording(recorder_maker(opened));
  if (const std::string problem = recording.problem(); !problem.empty())
    LOG(ERROR) << "recording: there is none: " << problem;
  const RecordedLog log(recording);
  std::optional<LiveStation> station;
  if (opened.config.station.on) station.emplace(opened.config, opened.source);
  LiveStation* const watched = station ? &*station : nullptr;
  if (watched) LOG(INFO) << "station: port " << watched->port();
  std::optional<EstimateFiles> files;
  if (!supervision.output.empty()) files.emplace(supervision.output);
  const auto on_estimate = [&](const Frame& frame, const Estimator::Aid& aid, const Estimate& estimate) {
    if (const auto recorder = recording.recorder()) recorder->add_frame(frame, aid, estimate);
    if (watched) watched->see(frame, aid, estimate);
    if (files) files->add(estimate);
  };
  LiveRun run(opened.config, std::move(opened.source), tap_of(recording, watched), on_estimate);
  Supervisor supervisor(run, recording, watched, supervision);
  supervisor.watch();
  run.stop();
  if (files) files->commit();

  nlohmann::ordered_json summary;
  summary["seconds"] = supervisor.seconds();
  summary.update(run.summary());
  summary["cpu_s"]["process"] = process_cpu_seconds();
  summary["peak_memory_bytes"] = peak_memory_bytes();
  if (watched) summary["station"] = watched->summary();
  const auto recorder = recording.recorder();
  if (recorder) {
    summary["recording"] = recording_json(*recorder);
  } else if (const std::string problem = recording.problem(); !problem.empty()) {
    summary["recording"]["last_problem"] = problem;
  }
  const std::string text = summary.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  if (!supervision.summary.empty()) write_whole_file(supervision.summary, text);
  if (recorder) write_whole_file(recorder->folder() / "run" / "summary.json", text);
  LOG(INFO) << "ended; " << run.frames().all() << " frames, " << run.frames().of(EstimateStatus::kOk)
            << " with a pose; " << latency_text(run.latency().all());
  run.rethrow();
  return 0;
}

}  // namespace perch
