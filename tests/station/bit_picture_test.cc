#include "perch/station/bit_picture.h"

#include <gtest/gtest.h>

#include "support/rng.h"

namespace perch {
namespace {

// As the page reads it (web/src/views/bits.js).
cv::Mat unpack(const std::vector<uint8_t>& bytes) {
  const int width = bytes[0] + 256 * bytes[1], height = bytes[2] + 256 * bytes[3];
  cv::Mat picture = cv::Mat::zeros(height, width, CV_8UC1);
  if (bytes[4] == 0) {
    for (int i = 0; i < width * height; ++i)
      picture.data[i] = (bytes[5 + static_cast<size_t>(i / 8)] >> (7 - i % 8)) & 1 ? 255 : 0;
    return picture;
  }
  int at = 0;
  uint8_t colour = 0;
  for (size_t i = 5; i < bytes.size(); ++i) {
    int length = 0, shift = 0;
    for (; bytes[i] & 128; ++i, shift += 7) length |= (bytes[i] & 127) << shift;
    length |= bytes[i] << shift;
    for (int k = 0; k < length; ++k) picture.data[at++] = colour;
    colour = colour ? 0 : 255;
  }
  EXPECT_EQ(at, width * height);
  return picture;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
}

TEST(BitPicture, ComesBackBitByBitWhateverIsInIt) {
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    cv::Mat picture(1 + rng.index(40), 1 + rng.index(170), CV_8UC1);
    const int change = 1 + rng.index(60);  // from noise to long runs
    uint8_t colour = 0;
    for (int k = 0; k < picture.rows * picture.cols; ++k) {
      if (rng.index(change) == 0) colour = colour ? 0 : 255;
      picture.data[k] = colour;
    }
    EXPECT_TRUE(same(unpack(pack_bits(picture)), picture)) << i;
  }
}

TEST(BitPicture, NeverTakesMoreThanABitAPixel) {
  TestRng rng;
  cv::Mat noise(120, 160, CV_8UC1);
  for (int k = 0; k < 160 * 120; ++k) noise.data[k] = rng.index(2) ? 255 : 0;
  EXPECT_EQ(pack_bits(noise).size(), 5u + 160 * 120 / 8);
  EXPECT_EQ(pack_bits(cv::Mat::zeros(120, 160, CV_8UC1)).size(), 5u + 3);  // 19200 is three groups of 7 bits
}

}  // namespace
}  // namespace perch
