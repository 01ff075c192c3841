#include "perch/station/bit_picture.h"

namespace perch {
namespace {

std::vector<uint8_t> header(const cv::Mat& picture, uint8_t kind) {
  const auto low = [](int v) { return static_cast<uint8_t>(v & 255); };
  return {low(picture.cols), low(picture.cols >> 8), low(picture.rows), low(picture.rows >> 8), kind};
}

void append_length(uint32_t length, std::vector<uint8_t>& bytes) {
  for (; length >= 128; length >>= 7) bytes.push_back(static_cast<uint8_t>(length | 128));
  bytes.push_back(static_cast<uint8_t>(length));
}

}  // namespace

std::vector<uint8_t> pack_bits(const cv::Mat& white) {
  std::vector<uint8_t> bits = header(white, 0), runs = header(white, 1);
  bool colour = false;
  uint32_t run = 0, pixels = 0;
  for (int row = 0; row < white.rows; ++row) {
    const uint8_t* at = white.ptr(row);
    for (int col = 0; col < white.cols; ++col, ++pixels) {
      const bool is_white = at[col] != 0;
      if (pixels % 8 == 0) bits.push_back(0);
      if (is_white) bits.back() = static_cast<uint8_t>(bits.back() | 128 >> (pixels % 8));
      if (is_white == colour) {
        ++run;
        continue;
      }
      append_length(run, runs);
      colour = is_white;
      run = 1;
    }
  }
  append_length(run, runs);
  return runs.size() < bits.size() ? runs : bits;
}

}  // namespace perch
