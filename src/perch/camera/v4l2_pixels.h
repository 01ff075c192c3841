#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "perch/camera/image_source.h"

namespace perch {

// A pixel format of V4L2 that we can read, by its four characters ("Y10" stands for "Y10 ").
struct V4l2PixelFormat {
  const char* name;
  // Grey by picking bytes: of each row those at `first`, `first + step` and so on; 16 bits, little end first,
  // are shifted down. A step of 0: decoded or converted.
  int first, step, shift;
  int to_bgr;       // OpenCV's code of the conversion to BGR; -1: it has no colour, or we do not read it
  int rows_x2;      // rows of bytes to a row of pixels, doubled: 3 where chroma follows the luma plane
  int bytes_pixel;  // of one row, to a pixel; 0: compressed
};

// Those that give the channel, the least work first.
std::vector<const V4l2PixelFormat*> v4l2_formats(Channel channel);

uint32_t fourcc_of(const std::string& name);
std::string fourcc_name(uint32_t fourcc);

// How a buffer's bytes lie.
struct V4l2Layout {
  const V4l2PixelFormat* format = nullptr;
  int width = 0, height = 0, stride = 0;  // px, px, bytes from row to row
};

// The picture in a buffer as grey, into memory that is reused when the size is the same. "" or what is wrong:
// a buffer too short, a JPEG that cannot be decoded or has another size.
std::string v4l2_grey(const V4l2Layout& layout, std::span<const uint8_t> bytes, Channel channel,
                      cv::Mat& grey, cv::Mat& scratch);

}  // namespace perch
