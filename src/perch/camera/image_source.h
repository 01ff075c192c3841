#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace perch {

enum class Channel { kGrey, kRed, kGreen, kBlue };

// One picture. An unreadable one is a frame too: it keeps its row in every output.
struct Frame {
  int64_t timestamp_ns = 0;    // mid-exposure, on the camera's clock
  cv::Mat grey;                // CV_8UC1, continuous; empty when `problem` says why
  std::string name;            // file, or file#number of a video
  std::filesystem::path file;  // between ImageSource::advance and ::read: what is to be read
  std::string problem;         // "…/17.png: truncated", empty when all is well
};

// Pictures in their order. Not thread-safe.
class ImageSource {
 public:
  virtual ~ImageSource() = default;
  // The next picture; false after the last one.
  bool next(Frame& frame) {
    if (!advance(frame)) return false;
    read(frame);
    return true;
  }
  // The same in two steps, for those who decode in parallel: `advance` says which picture is next, `read`
  // fills its pixels in. `advance` belongs to one thread; `read` may run in any, several at once.
  virtual bool advance(Frame& frame) = 0;
  virtual void read(Frame& frame) const = 0;
  // How many there are; -1 when that cannot be known.
  virtual int64_t size() const = 0;
  // What was wrong with the source as a whole and was skipped: rows of data.csv, a clock that went back.
  const std::vector<std::string>& problems() const { return problems_; }

 protected:
  std::vector<std::string> problems_;
};

// Opens what `camera.source` names; throws std::runtime_error naming what cannot be opened and why.
//   flight:FOLDER  the rows of mav0/cam0/data.csv; rows without a usable time are skipped and noted
//   images:GLOB    2.png before 10.png; names of 10 digits or more are times in ns, else 30 Hz from 0
//   video:FILE     through FFmpeg, with the file's own times from 0
// Silences OpenCV's log: what is wrong with a picture is in its frame.
std::unique_ptr<ImageSource> open_image_source(const std::string& source, Channel channel = Channel::kGrey);

// Reads one picture as `Frame::grey`: 8 or 16 bits, grey or colour, with an alpha or not. Sets `problem` and
// leaves `grey` empty when the file is missing, empty, truncated, too large or no picture. Grey of colour is
// BT.601's; an alpha is ignored, and so is a rotation in the EXIF data, since the lens model is that of the
// sensor. 16 bits become 8 by a shift of as many bits as the picture uses (10, 12, 14, 16) beyond 8: cameras
// of 12 bits store them in the lower end of 16. Pictures of more than 50 million pixels are refused.
void read_picture(const std::filesystem::path& file, Channel channel, Frame& frame);

}  // namespace perch
