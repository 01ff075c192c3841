#include "perch/detection/runs.h"

#include <bit>
#include <opencv2/core/hal/intrin.hpp>

namespace perch {
namespace {

// 16 pixels as bits, the leftmost the lowest: 1 where grey > level.
inline uint64_t white_bits_16(const uint8_t* grey, const cv::v_uint8x16& level) {
  return static_cast<uint32_t>(cv::v_signmask(cv::v_load(grey) > level));
}

inline uint64_t white_bits_64(const uint8_t* grey, const cv::v_uint8x16& level) {
  return white_bits_16(grey, level) | white_bits_16(grey + 16, level) << 16 |
         white_bits_16(grey + 32, level) << 32 | white_bits_16(grey + 48, level) << 48;
}

// The last `count` < 64 pixels of a row. Those that do not fill 16 are read together with some before them,
// which only a row of less than 16 has not.
inline uint64_t white_bits_tail(const uint8_t* grey, int count, int width, const cv::v_uint8x16& levels,
                                uint8_t level) {
  uint64_t bits = 0;
  int i = 0;
  for (; i + 16 <= count; i += 16) bits |= white_bits_16(grey + i, levels) << i;
  if (i == count) return bits;
  if (width >= 16) return bits | white_bits_16(grey + count - 16, levels) >> (16 - (count - i)) << i;
  for (; i < count; ++i) bits |= static_cast<uint64_t>(grey[i] > level) << i;
  return bits;
}

}  // namespace

void threshold_to_runs(const cv::Mat& grey, uint8_t level, int row_step, RunImage& image) {
  image.width = grey.cols;
  image.rows.clear();
  image.runs.clear();
  const cv::v_uint8x16 levels = cv::v_setall_u8(level);
  for (int y = 0; y < grey.rows; y += row_step) {
    const uint8_t* pixels = grey.ptr<uint8_t>(y);
    const int first = static_cast<int>(image.runs.size());
    const bool first_white = pixels[0] > level;
    uint64_t before = first_white ? 1 : 0;  // the colour left of the word: no change at column 0
    int begin = 0;
    for (int x = 0; x < grey.cols; x += 64) {
      const int count = grey.cols - x;
      const uint64_t bits = count >= 64 ? white_bits_64(pixels + x, levels)
                                        : white_bits_tail(pixels + x, count, grey.cols, levels, level);
      uint64_t changes = bits ^ ((bits << 1) | before);
      if (count < 64) changes &= (uint64_t{1} << count) - 1;
      for (; changes != 0; changes &= changes - 1) {
        const int column = x + std::countr_zero(changes);
        image.runs.push_back({begin, column, 0});
        begin = column;
      }
      before = bits >> 63;
    }
    image.runs.push_back({begin, grey.cols, 0});
    image.rows.push_back({first, static_cast<int>(image.runs.size()) - first, first_white});
  }
}

}  // namespace perch
