#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>

#include "perch/camera/camera_model.h"
#include "perch/camera/image_source.h"
#include "perch/estimator/estimator.h"
#include "perch/flight/nav_track.h"
#include "perch/flight/picture_recorder.h"
#include "perch/flight/recording_disk.h"

namespace perch {

struct RecorderOptions {
  std::filesystem::path folder;  // made where missing; the flight is a new folder in it, named by its start
  int queue_frames = 30;         // pictures that wait for the disk: a second's, 9 MB of 640x480
  // Or "ffv1": one video, about as large and twice the work; pictures of the camera's size only.
  std::string format = "png";
  // Below it no more pictures: the tables, which are small, and the rest of the system need some.
  double least_free_disk = 200e6;  // bytes
  std::shared_ptr<RecordingDisk> disk = real_disk();
};

// Writes a recorded flight (docs/FORMATS.md, with run/) while a live run goes on. Threads of its own write;
// whoever hands something in never waits for the disk: what does not fit the bounded queues is dropped and
// counted.
//
//   add_frame --> pictures, queue_frames of them --> cam0
//            '--> rows, some MB of them -----------> run/*.csv, nav0, gimbal0, at least every 0.2 s
//   add_bytes --> MAVLink frames, some MB ---------> run/mavlink.tlog
//   add_log ----> lines, some MB ------------------> run/log
//
// Everything that was written is whole and in the kernel's hands, so that kill -9 costs the last second at
// most. Every second a thread has the kernel bring it to the disk, so that a loss of power costs the last
// two, or what the disk takes longer.
//
// A replay is bit-exact when the resolved configuration says all that the estimator used. Where the mount
// (frames.body_from_base) came from the source of the pictures, put it into the configuration (as an
// override) before that is resolved: T_BS, a matrix, loses the last bit.
class FlightRecorder {
 public:
  enum class Direction { kIn, kOut };

  struct Counters {
    int64_t frames_written = 0;
    int64_t frames_dropped = 0;  // pictures; their estimates are in the tables nevertheless
    int64_t rows_dropped = 0;    // of the tables
    int64_t bytes_dropped = 0;   // MAVLink
    double disk_left = 0;        // bytes
    std::string last_problem;    // empty: none so far
  };

  // Throws std::runtime_error when the folder cannot be made, std::invalid_argument for options that make no
  // sense. `body_from_camera` is T_BS, where it is known.
  FlightRecorder(const RecorderOptions& options, const CameraModel& camera,
                 const std::string& resolved_config_yaml, const std::optional<Rigid3>& body_from_camera,
                 double rate_hz);
  ~FlightRecorder();  // closes
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;

  // Each may be called from any thread, waits for no disk and throws nothing.

  // A frame, what the estimator was given beside it, and what it said. In the order of the frames. The
  // picture is copied. False: the picture was dropped; rows are dropped and counted by themselves.
  bool add_frame(const Frame& frame, const Estimator::Aid& aid, const Estimate& estimate) noexcept;
  // What the navigation source knows of a moment of its clock, once position, attitude and velocity are all
  // known: a row of nav0. For scoring; the estimator's own share of it is in the aids.
  void add_navigation(const NavSample& sample) noexcept;
  // MAVLink bytes as they came or went, and when, on CLOCK_MONOTONIC.
  void add_bytes(Direction direction, int64_t monotonic_ns, std::span<const uint8_t> bytes) noexcept;
  // A row of run/events.csv; what is to be said in one line. On the camera's clock.
  void add_event(int64_t timestamp_ns, std::string_view what) noexcept;
  // A line of the program's log, without its end.
  void add_log(std::string_view line) noexcept;

  // Writes everything that was accepted, unless the disk refuses it, and waits for that; nothing is accepted
  // any more. For those who want the counters of the whole.
  void close() noexcept;

  Counters counters() const;
  // The flight's folder, the one that holds mav0 and run.
  const std::filesystem::path& folder() const { return folder_; }

 private:
  struct Logs;
  void complain(const std::string& what) noexcept;
  void add_rows(const Frame& frame, const Estimator::Aid& aid, const Estimate& estimate);
  void run();
  void write_logs();
  void keep_on_disk();

  const RecorderOptions options_;
  std::filesystem::path folder_;
  std::unique_ptr<Logs> logs_;
  std::unique_ptr<PictureRecorder> pictures_;
  std::mutex frame_mutex_;
  std::string row_;  // of add_rows
  int64_t last_gimbal_ns_ = std::numeric_limits<int64_t>::min();
  std::atomic<bool> closed_ = false;
  std::atomic<int64_t> last_frame_ns_ = 0;
  std::atomic<int64_t> rows_dropped_ = 0, bytes_dropped_ = 0;
  std::atomic<double> disk_left_ = 0;
  mutable std::mutex problem_mutex_;
  std::string last_problem_;
  std::mutex stop_mutex_;
  std::condition_variable stopped_;
  bool stop_ = false;
  std::thread thread_, sync_thread_;
};

}  // namespace perch
