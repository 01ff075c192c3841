#include "perch/detection/runs.h"

#include <bit>
#include <opencv2/core/hal/intrin.hpp>

// What finds and clears the lowest bit in one instruction each is not in every x86, but in nearly all.
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__)
#define PERCH_BIT_INSTRUCTIONS __attribute__((target_clones("default", "arch=x86-64-v3")))
#else
#define PERCH_BIT_INSTRUCTIONS
#endif

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

// Appends the column of every set bit. They are taken four at a time, whether there are as many or not: how
// many there are is what the processor guesses wrong, and to write one in vain costs less. Needs room for one
// more.
inline int* append_columns(uint64_t bits, int first_column, int* end) {
  while (bits != 0) {
    for (int i = 0; i < 4; ++i) {
      *end = first_column + std::countr_zero(bits);
      end += bits != 0;
      bits &= bits - 1;
    }
  }
  return end;
}

// The columns at which the colour of a row changes, into `columns`, which has room for as many and one more.
// Returns where they end.
PERCH_BIT_INSTRUCTIONS
int* colour_changes(const uint8_t* pixels, int width, uint8_t level, int* columns) {
  const cv::v_uint8x16 levels = cv::v_setall_u8(level);
  uint64_t before = pixels[0] > level ? 1 : 0;  // the colour left of the word: no change at column 0
  for (int x = 0; x < width; x += 64) {
    const int count = width - x;
    const uint64_t bits = count >= 64 ? white_bits_64(pixels + x, levels)
                                      : white_bits_tail(pixels + x, count, width, levels, level);
    uint64_t changes = bits ^ ((bits << 1) | before);
    if (count < 64) changes &= (uint64_t{1} << count) - 1;
    columns = append_columns(changes, x, columns);
    before = bits >> 63;
  }
  return columns;
}

// The same against a level for every pixel.
PERCH_BIT_INSTRUCTIONS
int* colour_changes(const uint8_t* pixels, const uint8_t* levels, int width, int* columns) {
  uint32_t before = pixels[0] > levels[0] ? 1 : 0;
  int x = 0;
  for (; x + 16 <= width; x += 16) {
    const auto bits = static_cast<uint32_t>(cv::v_signmask(cv::v_load(pixels + x) > cv::v_load(levels + x)));
    columns = append_columns((bits ^ ((bits << 1) | before)) & 0xFFFF, x, columns);
    before = bits >> 15;
  }
  for (; x < width; ++x) {
    const uint32_t white = pixels[x] > levels[x] ? 1 : 0;
    if (white != before) *columns++ = x;
    before = white;
  }
  return columns;
}

// Appends a row that changes its colour at the columns of `image.ends`, up to `last`, which has room for one
// more.
void append_runs(int* last, bool first_white, RunImage& image) {
  *last = image.width;
  const auto first = image.runs.size();
  const auto count = static_cast<size_t>(last - image.ends.data()) + 1;
  image.runs.resize(first + count);
  int begin = 0;
  for (size_t k = 0; k < count; ++k) {
    image.runs[first + k] = {begin, image.ends[k], 0};
    begin = image.ends[k];
  }
  image.rows.push_back({static_cast<int>(first), static_cast<int>(count), first_white});
}

}  // namespace

void append_row(const uint8_t* pixels, const uint8_t* levels, RunImage& image) {
  image.ends.resize(static_cast<size_t>(image.width) + 1);
  append_runs(colour_changes(pixels, levels, image.width, image.ends.data()), pixels[0] > levels[0], image);
}

void threshold_to_runs(const cv::Mat& grey, uint8_t level, int row_step, RunImage& image) {
  image.width = grey.cols;
  image.rows.clear();
  image.runs.clear();
  image.ends.resize(static_cast<size_t>(grey.cols) + 1);
  for (int y = 0; y < grey.rows; y += row_step) {
    const uint8_t* pixels = grey.ptr<uint8_t>(y);
    append_runs(colour_changes(pixels, grey.cols, level, image.ends.data()), pixels[0] > level, image);
  }
}

}  // namespace perch
