#include "perch/camera/v4l2_format.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>

namespace perch {

namespace {

constexpr uint32_t kMostFormats = 256;  // a driver that never ends its list has no more

std::vector<uint32_t> offered_formats(V4l2Kernel& kernel, int fd) {
  std::vector<uint32_t> offered;
  for (v4l2_fmtdesc each{}; each.index < kMostFormats; ++each.index) {
    each.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (kernel.ioctl(fd, VIDIOC_ENUM_FMT, &each) < 0) break;
    offered.push_back(each.pixelformat);
  }
  return offered;
}

// Sets a format with the size that is wanted; the driver writes what it made of it.
v4l2_pix_format set_format(V4l2Kernel& kernel, int fd, const V4l2PixelFormat& format,
                           const LiveOptions& options) {
  v4l2_format f{};
  f.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  v4l2_pix_format& pix = f.fmt.pix;
  int error = kernel.ioctl(fd, VIDIOC_G_FMT, &f);
  if (error >= 0) {
    if (options.width > 0) {
      pix.width = static_cast<uint32_t>(options.width);
      pix.height = static_cast<uint32_t>(options.height);
    }
    pix.pixelformat = fourcc_of(format.name);
    pix.field = V4L2_FIELD_NONE;
    pix.bytesperline = pix.sizeimage = 0;
    error = kernel.ioctl(fd, VIDIOC_S_FMT, &f);
  }
  if (error < 0) throw std::runtime_error(std::string("cannot set its format: ") + std::strerror(-error));
  return pix;
}

bool is_wanted(const v4l2_pix_format& pix, const V4l2PixelFormat& format, const LiveOptions& options) {
  const bool has_size = pix.width > 0 && pix.height > 0 && pix.width <= 16384 && pix.height <= 16384;
  const bool whole = pix.field == V4L2_FIELD_NONE || pix.field == V4L2_FIELD_ANY;  // no half pictures in turn
  return has_size && whole && pix.pixelformat == fourcc_of(format.name) &&
         (options.width == 0 || (pix.width == static_cast<uint32_t>(options.width) &&
                                 pix.height == static_cast<uint32_t>(options.height)));
}

V4l2Layout layout_of(const v4l2_pix_format& pix, const V4l2PixelFormat& format) {
  V4l2Layout layout{&format, static_cast<int>(pix.width), static_cast<int>(pix.height), 0};
  const auto row_bytes = static_cast<uint32_t>(layout.width * format.bytes_pixel);
  // Some drivers leave it 0. Above 1 MB it is nonsense, and every buffer then too short for it.
  layout.stride = static_cast<int>(std::clamp<uint32_t>(pix.bytesperline, row_bytes, 1U << 20));
  return layout;
}

// The rate that the camera takes when it is asked for one, Hz; the asked one when it does not say.
double set_rate(V4l2Kernel& kernel, int fd, double asked_hz) {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  v4l2_fract& period = parameters.parm.capture.timeperframe;
  period = {1000, static_cast<uint32_t>(std::lround(1000 * asked_hz))};
  if (kernel.ioctl(fd, VIDIOC_S_PARM, &parameters) < 0) return asked_hz;
  if (!(parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) || period.numerator == 0) return asked_hz;
  return static_cast<double>(period.denominator) / period.numerator;
}

std::string size_text(int64_t width, int64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

}  // namespace

V4l2Negotiated negotiate_v4l2(V4l2Kernel& kernel, int fd, const std::vector<const V4l2PixelFormat*>& formats,
                              const LiveOptions& options) {
  const std::vector<uint32_t> offered = offered_formats(kernel, fd);
  const V4l2PixelFormat* slow = nullptr;  // has the size and not the rate
  double slow_hz = 0;
  std::string others;
  for (const auto* format : formats) {
    if (std::find(offered.begin(), offered.end(), fourcc_of(format->name)) == offered.end()) continue;
    const v4l2_pix_format pix = set_format(kernel, fd, *format, options);
    if (!is_wanted(pix, *format, options)) {
      others += (others.empty() ? "" : ", ") + size_text(pix.width, pix.height) + " as " + format->name;
      continue;
    }
    const double rate_hz = options.rate_hz > 0 ? set_rate(kernel, fd, options.rate_hz) : 0;
    if (rate_hz >= 0.95 * options.rate_hz) return {layout_of(pix, *format), ""};  // 29.97 is 30
    if (rate_hz <= slow_hz) continue;
    slow = format;
    slow_hz = rate_hz;
  }
  if (slow) {
    const v4l2_pix_format pix = set_format(kernel, fd, *slow, options);
    set_rate(kernel, fd, options.rate_hz);
    if (!is_wanted(pix, *slow, options)) throw std::runtime_error("does not give a format twice");
    std::ostringstream text;
    text << "gives " << slow_hz << " Hz, " << options.rate_hz << " were asked for";
    return {layout_of(pix, *slow), text.str()};
  }
  if (others.empty()) {
    for (const uint32_t each : offered) others += (others.empty() ? "" : ", ") + fourcc_name(each);
    throw std::runtime_error("has no pixel format that is wanted, but " + (others.empty() ? "none" : others));
  }
  throw std::runtime_error("has no pictures of " + size_text(options.width, options.height) +
                           ", the nearest are " + others);
}

}  // namespace perch
