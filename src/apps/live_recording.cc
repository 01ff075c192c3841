#include "live_recording.h"

#include <utility>

namespace perch {

LiveRecording::LiveRecording(Make make) : make_(std::move(make)) {
  if (make_) start();
}

std::string LiveRecording::start() {
  if (!make_) return "record: outputs.record names no folder";
  if (recorder()) return "record: it is recording";
  try {
    std::shared_ptr<FlightRecorder> made = make_();
    const std::string folder = made->folder().filename().string();
    const std::lock_guard lock(mutex_);
    recorder_ = std::move(made);
    problem_.clear();
    return "recording " + folder;
  } catch (const std::exception& e) {
    const std::lock_guard lock(mutex_);
    problem_ = e.what();
    return "record: there is no recording: " + problem_;
  }
}

std::string LiveRecording::problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}

std::string LiveRecording::stop() {
  std::shared_ptr<FlightRecorder> stopped;
  {
    const std::lock_guard lock(mutex_);
    stopped.swap(recorder_);
  }
  if (!stopped) return "stop: nothing is recording";
  stopped->close();
  return "recorded " + stopped->folder().filename().string() + ": " +
         std::to_string(stopped->counters().frames_written) + " pictures";
}

nlohmann::json LiveRecording::status() const {
  const auto current = recorder();
  if (!current) return {{"on", false}, {"possible", static_cast<bool>(make_)}, {"problem", problem()}};
  const auto counters = current->counters();
  return {{"on", true},
          {"possible", true},
          {"folder", current->folder().filename().string()},
          {"frames", counters.frames_written},
          {"dropped", counters.frames_dropped},
          {"disk_left", counters.disk_left},
          {"problem", counters.last_problem}};
}

}  // namespace perch
