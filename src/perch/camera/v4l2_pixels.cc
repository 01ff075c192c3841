#include "perch/camera/v4l2_pixels.h"

#include <array>
#include <new>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "perch/camera/picture_file.h"
#include "perch/camera/to_grey.h"

namespace perch {

namespace {

// In the order of the work they make. GREY and the luma planes are copied; JPEGs take milliseconds.
constexpr std::array<V4l2PixelFormat, 13> kFormats{{
    {"GREY", 0, 1, 0, -1, 2, 1},
    {"NV12", 0, 1, 0, cv::COLOR_YUV2BGR_NV12, 3, 1},
    {"NV21", 0, 1, 0, cv::COLOR_YUV2BGR_NV21, 3, 1},
    {"YU12", 0, 1, 0, -1, 3, 1},  // its chroma rows have a stride of their own
    {"YUYV", 0, 2, 0, cv::COLOR_YUV2BGR_YUY2, 2, 2},
    {"UYVY", 1, 2, 0, cv::COLOR_YUV2BGR_UYVY, 2, 2},
    {"Y10", 0, 2, 2, -1, 2, 2},
    {"Y12", 0, 2, 4, -1, 2, 2},
    {"Y16", 0, 2, 8, -1, 2, 2},
    {"BGR3", 0, 0, 0, cv::COLOR_COLORCVT_MAX, 2, 3},  // no conversion
    {"RGB3", 0, 0, 0, cv::COLOR_RGB2BGR, 2, 3},
    {"MJPG", 0, 0, 0, cv::COLOR_COLORCVT_MAX, 0, 0},
    {"JPEG", 0, 0, 0, cv::COLOR_COLORCVT_MAX, 0, 0},
}};

void pick_bytes(const V4l2Layout& layout, const uint8_t* bytes, cv::Mat& grey) {
  const V4l2PixelFormat& format = *layout.format;
  grey.create(layout.height, layout.width, CV_8UC1);
  for (int y = 0; y < layout.height; ++y) {
    const uint8_t* from = bytes + static_cast<size_t>(y) * static_cast<size_t>(layout.stride) + format.first;
    auto* to = grey.ptr<uint8_t>(y);
    if (format.step == 1) {
      std::copy(from, from + layout.width, to);
    } else if (format.shift == 0) {
      for (int x = 0; x < layout.width; ++x) to[x] = from[2 * x];
    } else {
      for (int x = 0; x < layout.width; ++x) {
        to[x] = static_cast<uint8_t>((from[2 * x] | from[2 * x + 1] << 8) >> format.shift);
      }
    }
  }
}

// One channel of BGR, or the grey of it.
void pick_channel(const cv::Mat& bgr, Channel channel, cv::Mat& grey) {
  if (channel == Channel::kGrey) {
    cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  } else {
    cv::extractChannel(bgr, grey, bgr_index(channel));
  }
}

std::string decode(const V4l2Layout& layout, std::span<const uint8_t> bytes, Channel channel, cv::Mat& grey,
                   cv::Mat& scratch) {
  if (bytes.size() < 3 || bytes[0] != 0xFF || bytes[1] != 0xD8) return "no JPEG";
  if (const std::string problem = picture_file_problem(bytes); !problem.empty()) return problem;
  const cv::Mat coded(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<uint8_t*>(bytes.data()));
  if (channel == Channel::kGrey) {
    // Only the JPEG's luma is decoded then. `grey` is written anew, unless its size is right.
    cv::imdecode(coded, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION, &grey);
  } else {
    cv::imdecode(coded, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION, &scratch);
    if (!scratch.empty()) pick_channel(scratch, channel, grey);
  }
  const cv::Mat& decoded = channel == Channel::kGrey ? grey : scratch;
  if (decoded.empty()) return "no picture that can be decoded";
  if (decoded.cols != layout.width || decoded.rows != layout.height) {
    return "a picture of " + std::to_string(decoded.cols) + "x" + std::to_string(decoded.rows) +
           " in a stream of " + std::to_string(layout.width) + "x" + std::to_string(layout.height);
  }
  return "";
}

std::string convert(const V4l2Layout& layout, std::span<const uint8_t> bytes, Channel channel, cv::Mat& grey,
                    cv::Mat& scratch) {
  const V4l2PixelFormat& format = *layout.format;
  if (format.bytes_pixel == 0) return decode(layout, bytes, channel, grey, scratch);
  const bool picks = channel == Channel::kGrey && format.step > 0;
  const int rows = picks ? layout.height : layout.height * format.rows_x2 / 2;
  const size_t row_bytes = static_cast<size_t>(layout.width) * static_cast<size_t>(format.bytes_pixel);
  // The last row need not be followed by what makes up its stride.
  const size_t needed = static_cast<size_t>(rows - 1) * static_cast<size_t>(layout.stride) + row_bytes;
  if (bytes.size() < needed) {
    return "cut off: " + std::to_string(bytes.size()) + " bytes of " + std::to_string(needed);
  }
  if (picks) {
    pick_bytes(layout, bytes.data(), grey);
    return "";
  }
  const cv::Mat theirs(rows, layout.width, CV_MAKETYPE(CV_8U, format.bytes_pixel),
                       const_cast<uint8_t*>(bytes.data()), static_cast<size_t>(layout.stride));
  if (format.to_bgr == cv::COLOR_COLORCVT_MAX) {
    pick_channel(theirs, channel, grey);
  } else {
    cv::cvtColor(theirs, scratch, format.to_bgr);
    pick_channel(scratch, channel, grey);
  }
  return "";
}

}  // namespace

std::vector<const V4l2PixelFormat*> v4l2_formats(Channel channel) {
  std::vector<const V4l2PixelFormat*> formats;
  for (const V4l2PixelFormat& format : kFormats) {
    if (channel == Channel::kGrey || format.to_bgr >= 0) formats.push_back(&format);
  }
  return formats;
}

uint32_t fourcc_of(const std::string& name) {
  uint32_t fourcc = 0;
  for (size_t i = 0; i < 4; ++i) {
    fourcc |= static_cast<uint32_t>(static_cast<uint8_t>(i < name.size() ? name[i] : ' ')) << (8 * i);
  }
  return fourcc;
}

std::string fourcc_name(uint32_t fourcc) {
  std::string name;
  for (int i = 0; i < 4; ++i) {
    const auto c = static_cast<char>(fourcc >> (8 * i) & 0x7f);  // the top bit: big end first
    name += c >= ' ' ? c : '?';
  }
  while (!name.empty() && name.back() == ' ') name.pop_back();
  return name;
}

std::string v4l2_grey(const V4l2Layout& layout, std::span<const uint8_t> bytes, Channel channel,
                      cv::Mat& grey, cv::Mat& scratch) {
  try {
    return convert(layout, bytes, channel, grey, scratch);
  } catch (const cv::Exception& e) {
    return "cannot be converted (" + e.err + ")";
  } catch (const std::bad_alloc&) {
    return "too large for the memory";
  }
}

}  // namespace perch
