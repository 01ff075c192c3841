#pragma once

#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <poll.h>

#include <cerrno>
#include <cstring>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "camera/fake_clock.h"
#include "perch/camera/v4l2_kernel.h"
#include "perch/camera/v4l2_pixels.h"

namespace perch {

// A kernel with one camera, as V4L2's documentation has it, on a clock of its own. It watches over its use:
// nothing is mapped twice or left mapped, no buffer is queued twice, a descriptor is closed once. Each call
// can be made to fail.
class FakeV4l2 : public V4l2Kernel {
 public:
  struct Mode {
    std::string format;
    uint32_t width, height;
    double rate_hz;  // the most
    uint32_t padding = 0;
  };

  explicit FakeV4l2(FakeClock& clock) : clock_(clock) {}
  ~FakeV4l2() override {
    EXPECT_EQ(fd_, -1) << "left open";
    EXPECT_EQ(mapped(), 0U);
  }

  // The world, for tests to change.
  std::vector<Mode> modes = {{"YUYV", 64, 48, 30}};
  std::map<uint32_t, int32_t> controls = {{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY},
                                          {V4L2_CID_EXPOSURE_ABSOLUTE, 100},
                                          {V4L2_CID_AUTOGAIN, 1},
                                          {V4L2_CID_GAIN, 10}};
  uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  uint32_t stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  bool there = true;  // else ENODEV, as after unplugging
  bool frozen = false;
  uint32_t skip = 0;        // numbers left out before the next picture
  int broken = 0;           // so many of the next pictures are marked
  int short_bytes = 0;      // so many of the next pictures are cut
  bool size_event = false;  // tell of a new size
  uint8_t grey = 100;
  std::map<unsigned long, int> fails;    // request to errno, once
  int fail_call = -1, fail_errno = EIO;  // the call with that number fails; -1: none
  int calls = 0, opened = 0;
  double rate_hz = 30;
  Mode mode;
  int queued() const { return static_cast<int>(queue_.size()); }

  int open(const char* path) override {
    if (const int error = trouble(0)) return error;
    EXPECT_STREQ(path, "/dev/video0");
    EXPECT_EQ(fd_, -1) << "opened twice";
    ++opened;
    size_event = false;  // events are of a descriptor
    mode = modes.front();
    return fd_ = 7;
  }
  void close(int fd) override {
    EXPECT_EQ(fd, fd_);
    EXPECT_EQ(mapped(), 0U) << "left mapped";
    stop();
    buffers_.clear();
    fd_ = -1;
  }
  void* map(int fd, size_t length, int64_t offset) override {
    EXPECT_EQ(fd, fd_);
    if (trouble(1)) return nullptr;
    Buffer& buffer = buffers_.at(static_cast<size_t>(offset / 4096));
    EXPECT_FALSE(buffer.mapped);
    EXPECT_EQ(length, buffer.bytes.size());
    buffer.mapped = true;
    return buffer.bytes.data();
  }
  void unmap(void* start, size_t length) override {
    for (Buffer& buffer : buffers_) {
      if (buffer.bytes.data() != start) continue;
      EXPECT_TRUE(buffer.mapped);
      EXPECT_EQ(length, buffer.bytes.size());
      buffer.mapped = false;
      return;
    }
    ADD_FAILURE() << "unmapped what is not mapped";
  }
  int poll(int fd, int64_t timeout_ns) override {
    EXPECT_EQ(fd, fd_);
    if (const int error = trouble(2)) return error == -ENODEV ? POLLERR | POLLHUP : error;
    const int64_t until = clock_.now_ns() + timeout_ns;
    if (size_event) return POLLPRI;
    produce();
    if (done_.empty() && !frozen && streaming_ && !queue_.empty() && next_ns_ <= until) {
      clock_.sleep_until(next_ns_);
      produce();
    }
    if (!done_.empty()) return POLLIN;
    clock_.sleep_until(until);
    return 0;
  }
  int ioctl(int fd, unsigned long request, void* argument) override {
    EXPECT_EQ(fd, fd_);
    if (const int error = trouble(request)) return error;
    switch (request) {
      case VIDIOC_QUERYCAP:
        return query(*static_cast<v4l2_capability*>(argument));
      case VIDIOC_ENUM_FMT:
        return enumerate(*static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_G_FMT:
        return tell_format(static_cast<v4l2_format*>(argument)->fmt.pix);
      case VIDIOC_S_FMT:
        return set_format(static_cast<v4l2_format*>(argument)->fmt.pix);
      case VIDIOC_S_PARM:
        return set_rate(static_cast<v4l2_streamparm*>(argument)->parm.capture);
      case VIDIOC_QUERYCTRL:
        return query(*static_cast<v4l2_queryctrl*>(argument));
      case VIDIOC_S_CTRL:
        return set(*static_cast<v4l2_control*>(argument));
      case VIDIOC_G_CTRL:
        return tell(*static_cast<v4l2_control*>(argument));
      case VIDIOC_REQBUFS:
        return make_buffers(static_cast<v4l2_requestbuffers*>(argument)->count);
      case VIDIOC_QUERYBUF:
        return query(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_QBUF:
        return queue(static_cast<v4l2_buffer*>(argument)->index);
      case VIDIOC_DQBUF:
        return dequeue(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
        return start();
      case VIDIOC_STREAMOFF:
        return stop();
      case VIDIOC_SUBSCRIBE_EVENT:
        return 0;
      case VIDIOC_DQEVENT:
        static_cast<v4l2_event*>(argument)->type = V4L2_EVENT_SOURCE_CHANGE;
        size_event = false;
        return 0;
      default:
        return -ENOTTY;
    }
  }

 private:
  struct Buffer {
    std::vector<uint8_t> bytes;
    bool mapped = false, queued = false;
  };

  int trouble(unsigned long request) {
    if (calls++ == fail_call) return -fail_errno;
    if (!there && request != VIDIOC_STREAMOFF) return request == 0 ? -ENOENT : -ENODEV;
    const auto it = fails.find(request);
    if (it == fails.end()) return 0;
    const int error = it->second;
    fails.erase(it);
    return -error;
  }
  size_t mapped() const {
    size_t count = 0;
    for (const Buffer& buffer : buffers_) count += buffer.mapped;
    return count;
  }

  int query(v4l2_capability& can) const {
    can.capabilities =
        V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;  // of the whole card
    can.device_caps = capabilities;
    return 0;
  }
  int enumerate(v4l2_fmtdesc& each) const {
    std::vector<std::string> names;
    for (const Mode& m : modes) {
      if (names.empty() || names.back() != m.format) names.push_back(m.format);
    }
    if (each.index >= names.size()) return -EINVAL;
    each.pixelformat = fourcc_of(names[each.index]);
    return 0;
  }
  int tell_format(v4l2_pix_format& pix) const {
    pix.width = mode.width;
    pix.height = mode.height;
    pix.pixelformat = fourcc_of(mode.format);
    pix.field = V4L2_FIELD_NONE;
    const uint32_t wide =
        mode.format == "MJPG" ? 0 : mode.width * (mode.format == "YUYV" ? 2 : 1) + mode.padding;
    pix.bytesperline = wide;
    pix.sizeimage = wide > 0 ? wide * mode.height * (mode.format == "NV12" ? 3 : 2) / 2 : 65536;
    if (mode.format != "NV12" && wide > 0) pix.sizeimage = wide * mode.height;
    return 0;
  }
  // The nearest: the mode of that format and size, else the first of the format, else the first.
  int set_format(v4l2_pix_format& pix) {
    if (!buffers_.empty()) return -EBUSY;
    const Mode* best = &modes.front();
    for (const Mode& m : modes) {
      if (fourcc_of(m.format) != pix.pixelformat) continue;
      const bool size = m.width == pix.width && m.height == pix.height;
      if (best->format != m.format || size) best = &m;
    }
    mode = *best;
    return tell_format(pix);
  }
  int set_rate(v4l2_captureparm& capture) {
    capture.capability = V4L2_CAP_TIMEPERFRAME;
    rate_hz = std::min(
        mode.rate_hz, static_cast<double>(capture.timeperframe.denominator) / capture.timeperframe.numerator);
    capture.timeperframe = {1000, static_cast<uint32_t>(rate_hz * 1000)};
    return 0;
  }
  int query(v4l2_queryctrl& control) const {
    if (!controls.count(control.id)) return -EINVAL;
    control.minimum = 1;
    control.maximum = control.id == V4L2_CID_GAIN ? 64 : 2000;
    return 0;
  }
  int set(const v4l2_control& control) {
    if (!controls.count(control.id)) return -EINVAL;
    if (control.id == V4L2_CID_EXPOSURE_ABSOLUTE &&
        controls[V4L2_CID_EXPOSURE_AUTO] != V4L2_EXPOSURE_MANUAL) {
      return -EACCES;
    }
    controls[control.id] = control.value;
    return 0;
  }
  int tell(v4l2_control& control) const {
    if (!controls.count(control.id)) return -EINVAL;
    control.value = controls.at(control.id);
    return 0;
  }

  int make_buffers(uint32_t& count) {
    EXPECT_TRUE(buffers_.empty());
    v4l2_pix_format pix{};
    tell_format(pix);
    buffers_.resize(count);
    for (Buffer& buffer : buffers_) buffer.bytes.assign(pix.sizeimage, 0);
    return 0;
  }
  int query(v4l2_buffer& buffer) const {
    buffer.length = static_cast<uint32_t>(buffers_.at(buffer.index).bytes.size());
    buffer.m.offset = 4096 * buffer.index;
    return 0;
  }
  int queue(uint32_t index) {
    Buffer& buffer = buffers_.at(index);
    EXPECT_FALSE(buffer.queued);
    EXPECT_TRUE(buffer.mapped);
    buffer.queued = true;
    queue_.push_back(index);
    return 0;
  }
  int start() {
    streaming_ = true;
    sequence_ = 0;
    next_ns_ = clock_.now_ns() + period_ns();
    return 0;
  }
  int stop() {
    streaming_ = false;
    queue_.clear();
    done_.clear();
    for (Buffer& buffer : buffers_) buffer.queued = false;
    return 0;
  }
  int64_t period_ns() const { return static_cast<int64_t>(1e9 / rate_hz); }

  // Fills what should be full by now. The exposure begins 12 ms before the picture is there and ends 2 ms
  // before.
  void produce() {
    for (; streaming_ && !frozen && next_ns_ <= clock_.now_ns(); next_ns_ += period_ns()) {
      sequence_ += skip;
      skip = 0;
      const uint32_t number = sequence_++;
      if (queue_.empty()) continue;  // nowhere to put it
      v4l2_buffer full{};
      full.index = queue_.front();
      queue_.pop_front();
      std::vector<uint8_t>& bytes = buffers_[full.index].bytes;
      std::fill(bytes.begin(), bytes.end(), grey);
      full.bytesused = static_cast<uint32_t>(short_bytes > 0 ? bytes.size() / 2 : bytes.size());
      if (short_bytes > 0) --short_bytes;
      full.flags = stamp_flags | (broken > 0 ? V4L2_BUF_FLAG_ERROR : 0);
      if (broken > 0) --broken;
      full.sequence = number;
      const bool start = (stamp_flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
      const int64_t stamp = next_ns_ - (start ? 12'000'000 : 2'000'000);
      full.timestamp.tv_sec = stamp / 1'000'000'000;
      full.timestamp.tv_usec = stamp % 1'000'000'000 / 1000;
      done_.push_back(full);
    }
  }
  int dequeue(v4l2_buffer& buffer) {
    produce();
    if (done_.empty()) return -EAGAIN;
    buffer = done_.front();
    done_.pop_front();
    buffers_[buffer.index].queued = false;
    return 0;
  }

  FakeClock& clock_;
  int fd_ = -1;
  bool streaming_ = false;
  std::vector<Buffer> buffers_;
  std::deque<uint32_t> queue_;
  std::deque<v4l2_buffer> done_;
  uint32_t sequence_ = 0;
  int64_t next_ns_ = 0;
};

}  // namespace perch
