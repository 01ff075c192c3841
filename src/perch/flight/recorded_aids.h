#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <unordered_map>
#include <vector>

#include "perch/flight/aids_file.h"

namespace perch {

// What a live run's estimator was given, for the frames of its recording in their order. With the same
// configuration the estimator then says the same again, bit for bit, as far as the recording has all
// pictures: after a dropped one the filter has seen less than in the live run.
class RecordedAids {
 public:
  // Whether the flight is one of a live run.
  static bool are_there(const std::filesystem::path& flight);
  // Throws std::runtime_error when the file cannot be read.
  explicit RecordedAids(const std::filesystem::path& flight);

  // For the next frame. What the autopilot said beside frames that were dropped since the one before comes
  // with it. A frame the file does not know gets nothing.
  Estimator::Aid at(int64_t frame_timestamp_ns);

  // What is wrong with the file, and in what the replay so far differs from the live run. After the last
  // frame.
  std::vector<std::string> problems() const;

 private:
  std::filesystem::path file_;
  std::vector<std::string> problems_;
  std::vector<FrameAid> frames_;
  std::unordered_map<int64_t, size_t> index_;  // of the first frame of a time
  size_t next_ = 0;
  size_t dropped_ = 0, unknown_ = 0;
};

}  // namespace perch
