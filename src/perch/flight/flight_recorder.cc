#include "perch/flight/flight_recorder.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <stdexcept>

#include "perch/flight/aids_file.h"
#include "perch/flight/append_log.h"
#include "perch/flight/background.h"
#include "perch/flight/csv_number.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/sensor_file.h"
#include "perch/flight/tlog.h"
#include "perch/flight/write_nav.h"

namespace perch {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

namespace {

// Rows that wait for the disk, of each file: minutes of a live run's 100 kB a second.
constexpr size_t kMostWaiting = 16'000'000;
// A kill costs what is not with the kernel yet: a second at most, with room for a slow disk.
constexpr auto kWriteEvery = 200ms;
constexpr auto kLookAtDiskEvery = 1s;
constexpr auto kSyncEvery = 1s;

constexpr char kGimbalHeader[] = "#timestamp [ns],pan [rad],tilt [rad],zoom []\n";
constexpr char kEventsHeader[] = "#timestamp [ns],event\n";

// A new folder named by the time, 20261124T145111Z; a second one of that second gets a number.
fs::path make_flight_folder(const fs::path& parent) {
  fs::create_directories(parent);
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char name[32];
  std::strftime(name, sizeof name, "%Y%m%dT%H%M%SZ", &utc);
  for (int number = 1; number < 1000; ++number) {
    const std::string suffix = number == 1 ? "" : '-' + std::to_string(number);
    const fs::path folder = parent / (name + suffix);
    if (fs::create_directory(folder)) return folder;
  }
  throw std::runtime_error(parent.string() + ": no name is free for a new flight");
}

void write_text(RecordingDisk& disk, const fs::path& file, const std::string& text) {
  disk.create(file)->append(text);
}

// What CLOCK_REALTIME has more than CLOCK_MONOTONIC. Taken once: a clock that is set during the run does not
// show in its times.
int64_t unix_minus_monotonic_ns() {
  const auto ns = [](auto time) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
  };
  return ns(std::chrono::system_clock::now()) - ns(std::chrono::steady_clock::now());
}

// One line, whatever is in it.
std::string event_row(int64_t timestamp_ns, std::string_view what) {
  std::string row = std::to_string(timestamp_ns) + ",";
  row += what;
  std::replace_if(
      row.begin(), row.end(), [](unsigned char c) { return c < ' '; }, ' ');
  return row + '\n';
}

}  // namespace

struct FlightRecorder::Logs {
  Logs(RecordingDisk& disk, const fs::path& flight)
      : estimates(disk, flight / "run" / "estimates.csv", estimates_header(), kMostWaiting),
        states(disk, flight / "run" / "states.csv", states_header(), kMostWaiting),
        aids(disk, flight / "run" / "aids.csv", aids_header(), kMostWaiting),
        events(disk, flight / "run" / "events.csv", kEventsHeader, kMostWaiting),
        mavlink(disk, flight / "run" / "mavlink.tlog", "", kMostWaiting),
        log(disk, flight / "run" / "log", "", kMostWaiting),
        nav(disk, flight / "mav0" / "nav0" / "data.csv", nav_header(), kMostWaiting),
        gimbal(disk, flight / "mav0" / "gimbal0" / "data.csv", kGimbalHeader, kMostWaiting) {
    for (AppendLog* table : {&estimates, &states, &aids, &events}) table->create();
  }

  AppendLog estimates, states, aids, events, mavlink, log;
  AppendLog nav, gimbal;  // made with their first row: without any the flight has neither
  std::array<AppendLog*, 8> all{&aids, &estimates, &states, &events, &mavlink, &log, &nav, &gimbal};

  std::mutex link_mutex;  // of what follows
  TlogFramer in, out;
  std::string records;
  const int64_t unix_minus_monotonic = unix_minus_monotonic_ns();
};

FlightRecorder::FlightRecorder(const RecorderOptions& options, const CameraModel& camera,
                               const std::string& resolved_config_yaml,
                               const std::optional<Rigid3>& body_from_camera, double rate_hz)
    : options_(options) {
  if (options.queue_frames < 1) throw std::invalid_argument("queue_frames: expected 1 or more");
  if (options.format != "png" && options.format != "ffv1") {
    throw std::invalid_argument("format: expected png or ffv1, found " + options.format);
  }
  if (!(rate_hz > 0 && rate_hz < 1e4)) throw std::invalid_argument("rate: expected one above 0");
  if (!options.disk) throw std::invalid_argument("disk: expected one");
  folder_ = make_flight_folder(options.folder);
  RecordingDisk& disk = *options_.disk;
  const fs::path mav0 = folder_ / "mav0", cam0 = mav0 / "cam0";
  for (const fs::path& folder : {cam0, mav0 / "nav0", mav0 / "gimbal0", folder_ / "run"}) {
    fs::create_directories(folder);
  }
  write_text(disk, cam0 / "camera.cameramodel", camera_model_text(camera));
  write_text(disk, cam0 / "sensor.yaml",
             sensor_yaml({camera, body_from_camera, rate_hz, "# Written by perch-live.\n"}));
  write_text(disk, folder_ / "run" / "config.yaml", resolved_config_yaml);
  logs_ = std::make_unique<Logs>(disk, folder_);
  disk_left_ = disk.bytes_left(folder_);
  PictureRecorder::Options pictures;
  pictures.slots = options.queue_frames;
  pictures.size = {camera.width(), camera.height()};
  pictures.may_write = [this] { return disk_left_ >= options_.least_free_disk; };
  pictures.complain = [this](const std::string& what) { complain(what); };
  auto sink = options.format == "png" ? png_sink(disk, cam0)
                                      : ffv1_sink(disk, cam0, {camera.width(), camera.height()}, rate_hz);
  pictures_ = std::make_unique<PictureRecorder>(std::move(pictures), std::move(sink));
  thread_ = std::thread([this] { run(); });
  sync_thread_ = std::thread([this] { keep_on_disk(); });
}

FlightRecorder::~FlightRecorder() { close(); }

void FlightRecorder::close() noexcept {
  if (closed_.exchange(true)) return;
  {
    const std::lock_guard lock(frame_mutex_);  // who was let in before is done now
  }
  pictures_->close();
  const Counters c = counters();
  try {
    const std::lock_guard lock(logs_->link_mutex);
    logs_->records.clear();
    logs_->in.flush(logs_->records);
    logs_->out.flush(logs_->records);
    logs_->mavlink.add(logs_->records);
    logs_->events.add(event_row(
        last_frame_ns_, "recording ended: " + std::to_string(c.frames_written) + " pictures written and " +
                            std::to_string(c.frames_dropped) + " dropped; " + std::to_string(c.rows_dropped) +
                            " rows and " + std::to_string(c.bytes_dropped) + " bytes of MAVLink dropped"));
  } catch (const std::bad_alloc&) {  // then without
  }
  {
    const std::lock_guard lock(stop_mutex_);
    stop_ = true;
  }
  stopped_.notify_all();
  thread_.join();
  sync_thread_.join();
}

void FlightRecorder::add_rows(const Frame& frame, const Estimator::Aid& aid, const Estimate& estimate) {
  const auto add = [&](AppendLog& log, auto append) {
    row_.clear();
    append();
    if (!log.add(row_)) ++rows_dropped_;
  };
  add(logs_->aids, [&] { append_aid(frame.timestamp_ns, aid, row_); });
  add(logs_->estimates, [&] { append_estimate(estimate, row_); });
  if (estimate.state) add(logs_->states, [&] { append_state(*estimate.state, row_); });
  // A clock that went back has no place in gimbal0; the aids have all.
  if (!aid.angles || frame.timestamp_ns <= last_gimbal_ns_) return;
  last_gimbal_ns_ = frame.timestamp_ns;
  add(logs_->gimbal, [&] {
    append_number(row_, frame.timestamp_ns);
    append_field(row_, aid.angles->pan);
    append_field(row_, aid.angles->tilt);
    row_ += ',';
    if (aid.zoom) append_number(row_, *aid.zoom);
    row_ += '\n';
  });
}

bool FlightRecorder::add_frame(const Frame& frame, const Estimator::Aid& aid,
                               const Estimate& estimate) noexcept {
  try {
    const std::lock_guard lock(frame_mutex_);
    if (closed_) return false;
    last_frame_ns_ = frame.timestamp_ns;
    add_rows(frame, aid, estimate);
    return pictures_->add(frame);
  } catch (const std::exception&) {  // no memory
    ++rows_dropped_;
    return false;
  }
}

void FlightRecorder::add_navigation(const NavSample& sample) noexcept {
  try {
    std::string row;
    append_nav(sample, row);
    if (closed_ || !logs_->nav.add(row)) ++rows_dropped_;
  } catch (const std::exception&) {
    ++rows_dropped_;
  }
}

void FlightRecorder::add_event(int64_t timestamp_ns, std::string_view what) noexcept {
  try {
    if (closed_ || !logs_->events.add(event_row(timestamp_ns, what))) ++rows_dropped_;
  } catch (const std::exception&) {
    ++rows_dropped_;
  }
}

void FlightRecorder::add_log(std::string_view line) noexcept {
  try {
    if (closed_ || !logs_->log.add(std::string(line) + '\n')) ++rows_dropped_;
  } catch (const std::exception&) {
    ++rows_dropped_;
  }
}

void FlightRecorder::add_bytes(Direction direction, int64_t monotonic_ns,
                               std::span<const uint8_t> bytes) noexcept {
  try {
    const std::lock_guard lock(logs_->link_mutex);
    TlogFramer& framer = direction == Direction::kIn ? logs_->in : logs_->out;
    logs_->records.clear();
    framer.add((monotonic_ns + logs_->unix_minus_monotonic) / 1000, bytes, logs_->records);
    if (!closed_ && logs_->mavlink.add(logs_->records)) return;
  } catch (const std::exception&) {
  }
  bytes_dropped_ += static_cast<int64_t>(bytes.size());
}

// Only what is new is an event: a disk that stays full says so of every picture.
void FlightRecorder::complain(const std::string& what) noexcept {
  try {
    {
      const std::lock_guard lock(problem_mutex_);
      if (last_problem_ == what) return;
      last_problem_ = what;
    }
    logs_->events.add(event_row(last_frame_ns_, "recorder: " + what));
  } catch (const std::bad_alloc&) {  // then unsaid; it is counted
  }
}

FlightRecorder::Counters FlightRecorder::counters() const {
  Counters c;
  c.frames_written = pictures_->written();
  c.frames_dropped = pictures_->dropped();
  c.rows_dropped = rows_dropped_;
  c.bytes_dropped = bytes_dropped_;
  c.disk_left = disk_left_;
  const std::lock_guard lock(problem_mutex_);
  c.last_problem = last_problem_;
  return c;
}

void FlightRecorder::write_logs() {
  for (AppendLog* log : logs_->all) {
    try {
      log->write();
    } catch (const std::exception& e) {
      complain(e.what());
    }
  }
}

void FlightRecorder::run() {
  work_in_background();
  auto looked = std::chrono::steady_clock::now();
  std::unique_lock lock(stop_mutex_);
  while (!stopped_.wait_for(lock, kWriteEvery, [&] { return stop_; })) {
    lock.unlock();
    write_logs();
    if (const auto now = std::chrono::steady_clock::now(); now - looked >= kLookAtDiskEvery) {
      looked = now;
      disk_left_ = options_.disk->bytes_left(folder_);
    }
    lock.lock();
  }
  lock.unlock();
  write_logs();
}

// A thread of its own: a slow disk takes seconds, in which the tables go on to the kernel.
void FlightRecorder::keep_on_disk() {
  work_in_background();
  std::unique_lock lock(stop_mutex_);
  while (!stopped_.wait_for(lock, kSyncEvery, [&] { return stop_; })) {
    lock.unlock();
    try {
      options_.disk->sync(folder_);
    } catch (const std::exception& e) {
      complain(e.what());
    }
    lock.lock();
  }
}

}  // namespace perch
