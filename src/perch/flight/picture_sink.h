#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>

#include "perch/flight/recording_disk.h"

namespace perch {

// How the pictures of a recording are kept, and their rows in data.csv. One thread.
class PictureSink {
 public:
  virtual ~PictureSink() = default;
  // The picture, whole, and then its row. Throws std::runtime_error when it cannot be kept; it then has
  // neither, and the next may be kept again. An empty one is that of a frame nobody could read.
  virtual void write(int64_t timestamp_ns, const cv::Mat& grey) = 0;
};

// Both make cam0's data.csv; `cam0` exists. They throw std::runtime_error when they cannot.

// cam0/data/TIMESTAMP.png each; a frame nobody could read has a row without a file and is unreadable again.
std::unique_ptr<PictureSink> png_sink(RecordingDisk& disk, const std::filesystem::path& cam0);

// cam0/data.mkv, whose n-th frame is the n-th row's: FFV1, without loss, each frame by itself in a Matroska
// cluster. Pictures of another size, and frames without one, cannot be kept.
std::unique_ptr<PictureSink> ffv1_sink(RecordingDisk& disk, const std::filesystem::path& cam0, cv::Size size,
                                       double rate_hz);

}  // namespace perch
