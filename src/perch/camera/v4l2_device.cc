#include "perch/camera/v4l2_device.h"

#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <stdexcept>
#include <vector>

#include "perch/camera/v4l2_controls.h"
#include "perch/camera/v4l2_format.h"
#include "perch/config/error.h"

namespace perch {

namespace {

// One that is read, one that is filled, and two for whoever is late.
constexpr uint32_t kBuffers = 4;
constexpr int64_t kExposureAgeNs = 1'000'000'000;

class V4l2Device : public CameraDevice {
 public:
  V4l2Device(const std::string& device, const LiveOptions& options, Channel channel, V4l2Kernel& kernel,
             LiveClock& clock)
      : path_(device), options_(options), channel_(channel), kernel_(kernel), clock_(clock) {
    if (device.empty() || device[0] != '/') {
      throw ConfigError(
          "camera.source: expected v4l2: and a device such as /dev/video0, found \"v4l2:" + device + '"');
    }
    formats_ = v4l2_formats(channel);
    if (options.format.empty()) return;
    std::string names;
    for (const auto* format : formats_) names += (names.empty() ? "" : ", ") + std::string(format->name);
    std::erase_if(formats_, [&](const auto* format) { return format->name != options.format; });
    if (formats_.empty()) {
      throw ConfigError("camera.format: expected one of " + names + ", found \"" + options.format + '"');
    }
  }
  ~V4l2Device() override { V4l2Device::close(); }

  std::string name() const override { return "v4l2:" + path_; }

  void open() override {
    try {
      fd_ = kernel_.open(path_.c_str());
      if (fd_ < 0) throw std::runtime_error(std::strerror(-fd_));
      check_it_captures();
      set_format();
      set_v4l2_controls(kernel_, fd_, options_);
      map_buffers();
      subscribe();
      int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
      call(VIDIOC_STREAMON, &type, "cannot stream");
    } catch (const std::runtime_error& e) {
      close();
      throw std::runtime_error(name() + ": " + e.what());
    }
    exposure_read_ns_ = clock_.now_ns() - kExposureAgeNs;
    sequence_.reset();
    told_ = false;
  }

  void close() override {
    if (fd_ >= 0) {
      int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
      kernel_.ioctl(fd_, VIDIOC_STREAMOFF, &type);
      for (const auto& buffer : buffers_) kernel_.unmap(buffer.data(), buffer.size());
      kernel_.close(fd_);
    }
    buffers_.clear();
    fd_ = -1;
  }

  Grab grab(Frame& frame, int64_t timeout_ns) override {
    const int happened = kernel_.poll(fd_, timeout_ns);
    if (happened < 0) fail(std::strerror(-happened));
    if (happened & (POLLERR | POLLHUP | POLLNVAL)) fail("is gone, or has stopped");
    if (happened & POLLPRI) handle_event();
    if (!(happened & POLLIN)) return {};
    Grab grab;
    grab.problem = std::exchange(negotiation_, "");
    const auto buffer = newest(grab);
    if (!buffer) return grab;
    grab.picture = true;
    stamp(*buffer, frame, grab);
    const auto bytes = std::span<const uint8_t>(buffers_[buffer->index]);
    const std::string problem = v4l2_grey(
        layout_, bytes.first(std::min<size_t>(buffer->bytesused, bytes.size())), channel_, grey_, scratch_);
    if (problem.empty()) {
      frame.grey = grey_;
    } else {
      frame.problem = name() + ": " + problem;
    }
    give_back(*buffer);
    return grab;
  }

 private:
  [[noreturn]] void fail(const std::string& why) const { throw std::runtime_error(name() + ": " + why); }
  void call(unsigned long request, void* argument, const char* what) const {
    const int error = kernel_.ioctl(fd_, request, argument);
    if (error < 0) throw std::runtime_error(std::string(what) + ": " + std::strerror(-error));
  }

  void check_it_captures() const {
    v4l2_capability can{};
    call(VIDIOC_QUERYCAP, &can, "no camera");
    const uint32_t caps = can.capabilities & V4L2_CAP_DEVICE_CAPS ? can.device_caps : can.capabilities;
    if (!(caps & V4L2_CAP_VIDEO_CAPTURE)) {
      throw std::runtime_error(
          caps & V4L2_CAP_VIDEO_CAPTURE_MPLANE
              ? "gives its pictures in several planes only; try gst:v4l2src"
              : "gives no pictures: a camera may have several devices, one of them for these");
    }
    if (!(caps & V4L2_CAP_STREAMING)) throw std::runtime_error("cannot stream");
  }

  void set_format() {
    const V4l2Negotiated result = negotiate_v4l2(kernel_, fd_, formats_, options_);
    layout_ = result.layout;
    negotiation_ = result.problem.empty() ? "" : name() + ": " + result.problem;
  }

  void map_buffers() {
    v4l2_requestbuffers request{};
    request.count = kBuffers;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    call(VIDIOC_REQBUFS, &request, "gives no buffers");
    if (request.count < 2) throw std::runtime_error("gives no two buffers");
    for (uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer{};
      buffer.index = i;
      buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
      buffer.memory = V4L2_MEMORY_MMAP;
      call(VIDIOC_QUERYBUF, &buffer, "does not tell its buffers");
      void* start = buffer.length > 0 ? kernel_.map(fd_, buffer.length, buffer.m.offset) : nullptr;
      if (!start) throw std::runtime_error("its buffers cannot be mapped");
      buffers_.emplace_back(static_cast<uint8_t*>(start), buffer.length);
      call(VIDIOC_QBUF, &buffer, "takes no buffer");
    }
  }

  // Those that can tell of a new size do: HDMI receivers and the like.
  void subscribe() const {
    v4l2_event_subscription subscription{};
    subscription.type = V4L2_EVENT_SOURCE_CHANGE;
    kernel_.ioctl(fd_, VIDIOC_SUBSCRIBE_EVENT, &subscription);
  }

  void handle_event() const {
    v4l2_event event{};
    const int error = kernel_.ioctl(fd_, VIDIOC_DQEVENT, &event);
    if (error >= 0 && event.type == V4L2_EVENT_SOURCE_CHANGE)
      fail("its picture has changed its size or format");
  }

  // The last full buffer, the others given back. Sound ones alone: those that the driver marks are half a
  // picture.
  std::optional<v4l2_buffer> newest(Grab& grab) {
    std::optional<v4l2_buffer> best;
    for (size_t i = 0; i < buffers_.size(); ++i) {
      v4l2_buffer buffer{};
      buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
      buffer.memory = V4L2_MEMORY_MMAP;
      const int error = kernel_.ioctl(fd_, VIDIOC_DQBUF, &buffer);
      if (error == -EAGAIN) break;
      if (error < 0) fail(std::strerror(-error));
      if (buffer.index >= buffers_.size()) fail("gives a buffer that there is not");
      grab.lost += gap_before(buffer.sequence);
      const bool sound = !(buffer.flags & V4L2_BUF_FLAG_ERROR);
      if (!sound) grab.problem = name() + ": a picture that the driver marks as broken, dropped";
      if (!sound || best) {
        ++grab.lost;
        give_back(sound ? *best : buffer);
      }
      if (sound) best = buffer;
    }
    return best;
  }

  // How many numbers the driver left out. Drivers that start over or do not count leave none.
  int64_t gap_before(uint32_t sequence) {
    const auto step = static_cast<int32_t>(sequence - sequence_.value_or(sequence - 1));  // wraps
    sequence_ = sequence;
    return std::max(0, step - 1);
  }

  void give_back(v4l2_buffer buffer) {
    const int error = kernel_.ioctl(fd_, VIDIOC_QBUF, &buffer);
    if (error < 0) fail(std::string("takes no buffer: ") + std::strerror(-error));
  }

  void stamp(const v4l2_buffer& buffer, Frame& frame, Grab& grab) {
    const int64_t now = clock_.now_ns();
    if (now - exposure_read_ns_ >= kExposureAgeNs) {
      exposure_ = v4l2_exposure(kernel_, fd_);
      exposure_read_ns_ = now;
    }
    const int64_t half_ns = std::llround(exposure_.value_or(options_.exposure.value_or(0)) / 2 * 1e9);
    const bool known = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    const bool start = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    const int64_t stamp_ns =
        int64_t{buffer.timestamp.tv_sec} * 1'000'000'000 + int64_t{buffer.timestamp.tv_usec} * 1000;
    frame.timestamp_ns = known ? stamp_ns + (start ? half_ns : -half_ns) : now - half_ns;
    if (told_ || (known && half_ns > 0)) return;
    told_ = true;
    grab.problem = name() + (known ? ": the exposure is not known: its " +
                                         std::string(start ? "start" : "end") + " is taken for its middle"
                                   : ": pictures without a time: that of their arrival here is taken");
  }

  std::string path_;
  LiveOptions options_;
  Channel channel_;
  V4l2Kernel& kernel_;
  LiveClock& clock_;
  std::vector<const V4l2PixelFormat*> formats_;  // that are wanted, the best first
  int fd_ = -1;
  V4l2Layout layout_;
  std::string negotiation_;  // what could not be had, to be told with the first picture
  std::vector<std::span<uint8_t>> buffers_;
  std::optional<uint32_t> sequence_;  // of the last picture
  std::optional<double> exposure_;    // s
  int64_t exposure_read_ns_ = 0;
  bool told_ = false;  // what is wrong with the stamps, since it was opened
  cv::Mat grey_, scratch_;
};

}  // namespace

std::unique_ptr<CameraDevice> make_v4l2_device(const std::string& device, const LiveOptions& options,
                                               Channel channel, V4l2Kernel& kernel, LiveClock& clock) {
  return std::make_unique<V4l2Device>(device, options, channel, kernel, clock);
}

}  // namespace perch
