#include "perch/camera/video_source.h"

#include <cmath>
#include <stdexcept>

#include "perch/camera/to_grey.h"

namespace perch {

namespace fs = std::filesystem;

VideoReader::VideoReader(fs::path file) : file_(std::move(file)) {
  std::error_code ignored;
  if (!fs::exists(file_, ignored)) throw std::runtime_error(file_.string() + ": no such file");
  try {
    capture_.open(file_.string(), cv::CAP_FFMPEG);
  } catch (const cv::Exception&) {
    capture_.release();
  }
  if (!capture_.isOpened()) throw std::runtime_error(file_.string() + ": no video that can be decoded");
}

bool VideoReader::seek(int64_t number) {
  try {
    // Frame by frame: jumping by number or time is only as good as the file's index.
    while (next_ <= number) {
      if (!capture_.grab()) return false;
      ++next_;
    }
  } catch (const cv::Exception&) {
    return false;
  }
  return true;
}

void VideoReader::read(Channel channel, Frame& frame) {
  frame.grey.release();
  frame.problem = file_.string() + ": frame " + std::to_string(next_ - 1) + " cannot be decoded";
  try {
    cv::Mat picture;  // a new one each time: the capture's own is overwritten by the next frame
    if (!capture_.retrieve(picture) || picture.empty()) return;
    frame.grey = to_grey(picture, channel);
    if (frame.grey.data == picture.data) frame.grey = frame.grey.clone();
    frame.problem.clear();
  } catch (const cv::Exception&) {
  }
}

double VideoReader::position_ms() { return capture_.get(cv::CAP_PROP_POS_MSEC); }
double VideoReader::rate_hz() { return capture_.get(cv::CAP_PROP_FPS); }
int64_t VideoReader::count() {
  const double count = capture_.get(cv::CAP_PROP_FRAME_COUNT);
  return count >= 1 && count < 1e12 ? static_cast<int64_t>(count) : -1;
}

namespace {

class VideoSource : public ImageSource {
 public:
  VideoSource(const fs::path& file, Channel channel) : name_(file.string()), video_(file), channel_(channel) {
    const double rate = video_.rate_hz();
    if (rate > 0.1 && rate < 1e5) period_ns_ = static_cast<int64_t>(1e9 / rate);
  }

  void read(Frame&) const override {}  // decoded in `advance`: in their order only
  bool advance(Frame& frame) override {
    frame = Frame{};
    if (!video_.seek(number_)) {
      if (number_ < size() && problems_.empty()) {
        problems_.push_back(name_ + ": ends after " + std::to_string(number_) + " of " +
                            std::to_string(size()) + " frames");
      }
      return false;
    }
    const double ms = video_.position_ms();
    const bool usable = std::isfinite(ms) && std::abs(ms) < 1e15;
    const int64_t time = usable ? std::llround(ms * 1e6) : 0;
    // Not all files say when a frame is to be shown.
    last_ns_ = number_ == 0 || time > last_ns_ ? time : last_ns_ + period_ns_;
    frame.timestamp_ns = last_ns_;
    frame.name = fs::path(name_).filename().string() + "#" + std::to_string(number_++);
    video_.read(channel_, frame);
    return true;
  }
  int64_t size() const override { return count_; }

 private:
  std::string name_;
  VideoReader video_;
  Channel channel_;
  int64_t count_ = video_.count();
  int64_t number_ = 0, last_ns_ = 0, period_ns_ = kNominalPeriodNs;
};

}  // namespace

std::unique_ptr<ImageSource> open_video(const fs::path& file, Channel channel) {
  return std::make_unique<VideoSource>(file, channel);
}

}  // namespace perch
