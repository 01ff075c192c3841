extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>

#include "perch/flight/matroska.h"
#include "perch/flight/picture_sink.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

// FFmpeg's FFV1 encoder for pictures of one size. Level 3, whose slices have checksums; every frame a key
// frame.
class Encoder {
 public:
  Encoder(cv::Size size, double rate_hz) {
    const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_FFV1);
    context_.reset(codec ? avcodec_alloc_context3(codec) : nullptr);
    frame_.reset(av_frame_alloc());
    packet_.reset(av_packet_alloc());
    if (!context_ || !frame_ || !packet_) throw std::runtime_error("FFV1: this FFmpeg cannot encode it");
    context_->width = frame_->width = size.width;
    context_->height = frame_->height = size.height;
    context_->pix_fmt = AV_PIX_FMT_GRAY8;
    frame_->format = AV_PIX_FMT_GRAY8;
    context_->time_base = {1, std::max(1, static_cast<int>(std::lround(rate_hz)))};
    context_->gop_size = 1;
    context_->level = 3;
    context_->thread_count = 1;
    if (avcodec_open2(context_.get(), codec, nullptr) != 0 || av_frame_get_buffer(frame_.get(), 0) != 0) {
      throw std::runtime_error("FFV1: pictures of " + std::to_string(size.width) + "x" +
                               std::to_string(size.height) + " cannot be encoded");
    }
  }

  std::string_view extradata() const {
    return {reinterpret_cast<const char*>(context_->extradata),
            static_cast<size_t>(context_->extradata_size)};
  }

  // Valid until the next call.
  std::string_view encode(const cv::Mat& grey) {
    bool done = av_frame_make_writable(frame_.get()) == 0;
    for (int y = 0; done && y < grey.rows; ++y) {
      std::memcpy(frame_->data[0] + static_cast<ptrdiff_t>(y) * frame_->linesize[0], grey.ptr(y),
                  static_cast<size_t>(grey.cols));
    }
    frame_->pts = next_pts_++;
    av_packet_unref(packet_.get());
    done = done && avcodec_send_frame(context_.get(), frame_.get()) == 0 &&
           avcodec_receive_packet(context_.get(), packet_.get()) == 0;
    if (!done) throw std::runtime_error("FFV1: a picture cannot be encoded");
    return {reinterpret_cast<const char*>(packet_->data), static_cast<size_t>(packet_->size)};
  }

 private:
  struct Free {
    void operator()(AVCodecContext* p) const { avcodec_free_context(&p); }
    void operator()(AVFrame* p) const { av_frame_free(&p); }
    void operator()(AVPacket* p) const { av_packet_free(&p); }
  };
  std::unique_ptr<AVCodecContext, Free> context_;
  std::unique_ptr<AVFrame, Free> frame_;
  std::unique_ptr<AVPacket, Free> packet_;
  int64_t next_pts_ = 0;
};

class Ffv1Sink : public PictureSink {
 public:
  Ffv1Sink(RecordingDisk& disk, const fs::path& cam0, cv::Size size, double rate_hz)
      : size_(size), encoder_(size, rate_hz) {
    video_ = disk.create(cam0 / "data.mkv");
    video_->append(
        matroska_header({size.width, size.height, std::llround(1e9 / rate_hz), encoder_.extradata()}));
    rows_ = disk.create(cam0 / "data.csv");
    rows_->append("#timestamp [ns],filename\n");
  }

  ~Ffv1Sink() override {
    try {
      write_rows();
    } catch (const std::exception&) {  // frames without a row, at the end, where they do no harm
    }
  }

  void write(int64_t timestamp_ns, const cv::Mat& grey) override {
    if (grey.size() != size_) throw std::runtime_error("a picture that the video cannot hold");
    if (!start_ns_) start_ns_ = timestamp_ns;
    cluster_.clear();
    append_matroska_cluster((timestamp_ns - *start_ns_) / 1'000'000, encoder_.encode(grey), cluster_);
    write_rows();
    video_->append(cluster_);
    // From here on the video has the frame: a row that the disk refuses comes before the next frame.
    unwritten_rows_ += std::to_string(timestamp_ns) + ",data.mkv\n";
    try {
      write_rows();
    } catch (const std::runtime_error&) {  // said then
    }
  }

 private:
  void write_rows() {
    if (unwritten_rows_.empty()) return;
    rows_->append(unwritten_rows_);
    unwritten_rows_.clear();
  }

  const cv::Size size_;
  Encoder encoder_;
  std::unique_ptr<RecordingFile> video_, rows_;
  std::optional<int64_t> start_ns_;
  std::string cluster_, unwritten_rows_;
};

}  // namespace

std::unique_ptr<PictureSink> ffv1_sink(RecordingDisk& disk, const fs::path& cam0, cv::Size size,
                                       double rate_hz) {
  return std::make_unique<Ffv1Sink>(disk, cam0, size, rate_hz);
}

}  // namespace perch
