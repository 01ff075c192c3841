#include "perch/camera/v4l2_controls.h"

#include <linux/videodev2.h>

#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>

namespace perch {

namespace {

constexpr double kExposureUnit = 1e-4;  // of V4L2_CID_EXPOSURE_ABSOLUTE, s

std::optional<v4l2_queryctrl> find(V4l2Kernel& kernel, int fd, uint32_t id) {
  v4l2_queryctrl control{};
  control.id = id;
  if (kernel.ioctl(fd, VIDIOC_QUERYCTRL, &control) < 0 || (control.flags & V4L2_CTRL_FLAG_DISABLED)) {
    return std::nullopt;
  }
  return control;
}

int set(V4l2Kernel& kernel, int fd, uint32_t id, int32_t value) {
  v4l2_control control{id, value};
  return kernel.ioctl(fd, VIDIOC_S_CTRL, &control);
}

// `unit` is that of the control in the option's own.
void set_checked(V4l2Kernel& kernel, int fd, const v4l2_queryctrl& control, const char* key, double value,
                 double unit) {
  const double units = value / unit;
  std::ostringstream text;
  text << "camera." << key << ": " << value;
  if (std::isnan(units) || units < control.minimum - 0.5 || units > control.maximum + 0.5) {
    text << ": the camera takes " << control.minimum * unit << " to " << control.maximum * unit;
    throw std::runtime_error(text.str());
  }
  const int error = set(kernel, fd, control.id, static_cast<int32_t>(std::lround(units)));
  if (error < 0) throw std::runtime_error(text.str() + ": " + std::strerror(-error));
}

}  // namespace

void set_v4l2_controls(V4l2Kernel& kernel, int fd, const LiveOptions& options) {
  // Not every camera has the switches: those that do not need them.
  if (options.rate_hz > 0) set(kernel, fd, V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);
  if (options.exposure) {
    set(kernel, fd, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
    const auto control = find(kernel, fd, V4L2_CID_EXPOSURE_ABSOLUTE);
    if (!control) throw std::runtime_error("camera.exposure: the camera has no exposure in units of time");
    set_checked(kernel, fd, *control, "exposure", *options.exposure, kExposureUnit);
  }
  if (options.gain) {
    set(kernel, fd, V4L2_CID_AUTOGAIN, 0);
    auto control = find(kernel, fd, V4L2_CID_GAIN);
    if (!control) control = find(kernel, fd, V4L2_CID_ANALOGUE_GAIN);
    if (!control) throw std::runtime_error("camera.gain: the camera has no gain");
    set_checked(kernel, fd, *control, "gain", *options.gain, 1);
  }
}

std::optional<double> v4l2_exposure(V4l2Kernel& kernel, int fd) {
  v4l2_control control{V4L2_CID_EXPOSURE_ABSOLUTE, 0};
  if (kernel.ioctl(fd, VIDIOC_G_CTRL, &control) < 0 || control.value <= 0) return std::nullopt;
  return control.value * kExposureUnit;
}

}  // namespace perch
