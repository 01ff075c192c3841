#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/videoio.hpp>
#include <string>

#include "perch/camera/image_source.h"

namespace perch {

// A period for pictures that say nothing of their time: 30 Hz.
inline constexpr int64_t kNominalPeriodNs = 33'333'333;

// The frames of a file in their order, through FFmpeg.
class VideoReader {
 public:
  // Throws std::runtime_error naming a file that cannot be opened.
  explicit VideoReader(std::filesystem::path file);
  // Goes to the frame with that number, which must not lie before the last one; false when there is none.
  bool seek(int64_t number);
  // Decodes the frame of the last seek into `frame.grey` or `frame.problem`.
  void read(Channel channel, Frame& frame);
  // When it is shown, in ms after the first; NaN where the file does not say.
  double position_ms();
  double rate_hz();
  int64_t count();  // as the header says, which may be wrong; -1 without

 private:
  std::filesystem::path file_;
  cv::VideoCapture capture_;
  int64_t next_ = 0;  // the number of the frame that the next grab gives
};

// A video by itself; its times are those of the file, from 0, or at its rate where these do not increase.
std::unique_ptr<ImageSource> open_video(const std::filesystem::path& file, Channel channel);

}  // namespace perch
