#include "perch/detection/runs.h"

#include <bit>
#include <opencv2/core/hal/intrin.hpp>

namespace perch {
namespace {

// 64 pixels as bits, the leftmost the lowest: 1 where grey > level.
inline uint64_t white_bits_64(const uint8_t* grey, const cv::v_uint8x16& level) {
  uint64_t bits = 0;
  for (int part = 0; part < 4; ++part) {
    const int mask = cv::v_signmask(cv::v_load(grey + 16 * part) > level);
    bits |= static_cast<uint64_t>(static_cast<uint32_t>(mask)) << (16 * part);
  }
  return bits;
}

inline uint64_t white_bits_tail(const uint8_t* grey, int count, uint8_t level) {
  uint64_t bits = 0;
  for (int i = 0; i < count; ++i) bits |= static_cast<uint64_t>(grey[i] > level) << i;
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
      const uint64_t bits =
          count >= 64 ? white_bits_64(pixels + x, levels) : white_bits_tail(pixels + x, count, level);
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
