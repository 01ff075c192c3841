#include "perch/detection/grey_range.h"

#include <array>

#include "support/random_picture.h"

namespace perch {
namespace {

// The paper's words: the lowest and the highest level whose count is not zero.
GreyRange from_histogram(const cv::Mat& grey, int row_step) {
  std::array<int, 256> count{};
  for (int y = 0; y < grey.rows; y += row_step) {
    for (int x = 0; x < grey.cols; ++x) ++count[grey.at<uint8_t>(y, x)];
  }
  int lowest = 0, highest = 255;
  while (count[static_cast<size_t>(lowest)] == 0) ++lowest;
  while (count[static_cast<size_t>(highest)] == 0) --highest;
  return {static_cast<uint8_t>(lowest), static_cast<uint8_t>(highest)};
}

void expect_as_histogram(const cv::Mat& grey, int row_step) {
  const GreyRange range = sampled_grey_range(grey, row_step);
  const GreyRange expected = from_histogram(grey, row_step);
  EXPECT_EQ(int{range.lowest}, int{expected.lowest}) << grey.cols << "x" << grey.rows << " step " << row_step;
  EXPECT_EQ(int{range.highest}, int{expected.highest})
      << grey.cols << "x" << grey.rows << " step " << row_step;
}

TEST(GreyRange, IsTheEndsOfTheHistogramOfTheSampledRows) {
  TestRng rng;
  for (int i = 0; i < 500; ++i) {
    const int low = rng.index(256);
    const cv::Mat grey =
        random_picture(rng, 1 + rng.index(70), 1 + rng.index(30), low, low + rng.index(256 - low));
    expect_as_histogram(grey, 1 + rng.index(9));
  }
}

TEST(GreyRange, OfOnePixelIsThatPixel) {
  for (const int level : {0, 1, 127, 128, 254, 255}) {
    const GreyRange range = sampled_grey_range(cv::Mat(1, 1, CV_8UC1, cv::Scalar(level)), 7);
    EXPECT_EQ(int{range.lowest}, level);
    EXPECT_EQ(int{range.highest}, level);
  }
}

TEST(GreyRange, SeesTheExtremesAtEveryPlaceOfARow) {
  for (int width = 1; width <= 50; ++width) {
    for (int x = 0; x < width; ++x) {
      cv::Mat grey(1, width, CV_8UC1, cv::Scalar(100));
      grey.at<uint8_t>(0, x) = 3;
      expect_as_histogram(grey, 7);
      grey.at<uint8_t>(0, x) = 250;
      expect_as_histogram(grey, 7);
    }
  }
}

TEST(GreyRange, LooksAtNothingBesideAPartOfAPicture) {
  cv::Mat around(40, 100, CV_8UC1, cv::Scalar(0));
  around(cv::Rect(50, 0, 50, 40)) = 255;
  cv::Mat part = around(cv::Rect(10, 8, 37, 20));
  part = 120;
  const GreyRange range = sampled_grey_range(part, 1);
  EXPECT_EQ(int{range.lowest}, 120);
  EXPECT_EQ(int{range.highest}, 120);
}

TEST(ThresholdLevel, LiesAtItsFractionOfTheRange) {
  EXPECT_EQ(int{threshold_level({0, 100}, 0.65)}, 65);
  EXPECT_EQ(int{threshold_level({20, 220}, 0.5)}, 120);
  EXPECT_EQ(int{threshold_level({7, 7}, 0.65)}, 7);
  EXPECT_EQ(int{threshold_level({0, 255}, 0)}, 0);
  EXPECT_EQ(int{threshold_level({0, 255}, 1)}, 255);
}

}  // namespace
}  // namespace perch
