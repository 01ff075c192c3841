#include "perch/detection/local_mean.h"

#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>

namespace perch {
namespace {

// Adds a row to the columns' sums or takes it away.
template <bool kAdd>
void add_row(const uint8_t* row, int width, uint16_t* columns) {
  int x = 0;
  for (; x + 16 <= width; x += 16) {
    cv::v_uint16x8 low, high;
    cv::v_expand(cv::v_load(row + x), low, high);
    const cv::v_uint16x8 a = cv::v_load(columns + x), b = cv::v_load(columns + x + 8);
    cv::v_store(columns + x, kAdd ? a + low : a - low);
    cv::v_store(columns + x + 8, kAdd ? b + high : b - high);
  }
  for (; x < width; ++x) columns[x] = static_cast<uint16_t>(kAdd ? columns[x] + row[x] : columns[x] - row[x]);
}

}  // namespace

void LocalMean::threshold(const cv::Mat& grey, int reach, int contrast, RunImage& image) {
  const int width = grey.cols, height = grey.rows;
  image.width = width;
  image.rows.clear();
  image.runs.clear();
  columns_.assign(static_cast<size_t>(width), 0);
  before_.resize(static_cast<size_t>(width) + 1);
  levels_.resize(static_cast<size_t>(width));
  for (int y = 0; y < std::min(reach, height); ++y)
    add_row<true>(grey.ptr<uint8_t>(y), width, columns_.data());
  for (int y = 0; y < height; ++y) {
    if (y + reach < height) add_row<true>(grey.ptr<uint8_t>(y + reach), width, columns_.data());
    if (y > reach) add_row<false>(grey.ptr<uint8_t>(y - reach - 1), width, columns_.data());
    const int rows = std::min(y + reach, height - 1) - std::max(y - reach, 0) + 1;
    uint32_t sum = 0;
    for (size_t x = 0; x < columns_.size(); ++x) {
      before_[x] = sum;
      sum += columns_[x];
    }
    before_[columns_.size()] = sum;
    // A mean of at most 255 over at most 31 x 31 px, in fixed point.
    constexpr int kShift = 22;
    const auto level = [&](int first, int last) {
      const auto pixels = static_cast<uint32_t>(rows * (last - first + 1));
      const uint32_t total = before_[static_cast<size_t>(last) + 1] - before_[static_cast<size_t>(first)];
      return static_cast<uint8_t>(std::min<uint32_t>(
          (total * ((1U << kShift) / pixels) >> kShift) + static_cast<uint32_t>(contrast), 255));
    };
    const int left = std::min(reach, width), right = std::max(left, width - reach);
    for (int x = 0; x < left; ++x) levels_[static_cast<size_t>(x)] = level(0, std::min(x + reach, width - 1));
    const uint32_t per = (1U << kShift) / static_cast<uint32_t>(rows * (2 * reach + 1));
    const uint32_t* const low = before_.data() - reach;
    const uint32_t* const high = before_.data() + reach + 1;
    for (int x = left; x < right; ++x) {
      levels_[static_cast<size_t>(x)] = static_cast<uint8_t>(
          std::min<uint32_t>(((high[x] - low[x]) * per >> kShift) + static_cast<uint32_t>(contrast), 255));
    }
    for (int x = right; x < width; ++x)
      levels_[static_cast<size_t>(x)] = level(std::max(x - reach, 0), width - 1);
    append_row(grey.ptr<uint8_t>(y), levels_.data(), image);
  }
}

void halve(const cv::Mat& grey, cv::Mat& half) {
  half.create(grey.rows / 2, grey.cols / 2, CV_8UC1);
  const cv::v_uint16x8 low_byte = cv::v_setall_u16(0xFF), round = cv::v_setall_u16(2);
  for (int y = 0; y < half.rows; ++y) {
    const uint8_t* above = grey.ptr<uint8_t>(2 * y);
    const uint8_t* below = grey.ptr<uint8_t>(2 * y + 1);
    uint8_t* out = half.ptr<uint8_t>(y);
    const auto pairs = [&](const uint8_t* row) {
      const cv::v_uint16x8 two = cv::v_reinterpret_as_u16(cv::v_load(row));
      return (two & low_byte) + cv::v_shr<8>(two);
    };
    int x = 0;
    for (; x + 16 <= half.cols; x += 16) {
      const cv::v_uint16x8 left = pairs(above + 2 * x) + pairs(below + 2 * x) + round;
      const cv::v_uint16x8 right = pairs(above + 2 * x + 16) + pairs(below + 2 * x + 16) + round;
      cv::v_store(out + x, cv::v_pack(cv::v_shr<2>(left), cv::v_shr<2>(right)));
    }
    for (; x < half.cols; ++x) {
      out[x] =
          static_cast<uint8_t>((above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1] + 2) / 4);
    }
  }
}

}  // namespace perch
