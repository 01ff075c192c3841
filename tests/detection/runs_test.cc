#include "perch/detection/runs.h"

#include <vector>

#include "support/random_picture.h"

namespace perch {
namespace {

// Pixel by pixel: the runs cover each row from end to end, and each has one colour, unlike its neighbours'.
void expect_runs_of(const cv::Mat& grey, uint8_t level, int row_step, const RunImage& image) {
  ASSERT_EQ(image.width, grey.cols);
  ASSERT_EQ(static_cast<int>(image.rows.size()), (grey.rows + row_step - 1) / row_step);
  size_t next = 0;
  for (size_t i = 0; i < image.rows.size(); ++i) {
    const auto& row = image.rows[i];
    ASSERT_EQ(static_cast<size_t>(row.first), next);
    ASSERT_GE(row.count, 1);
    next += static_cast<size_t>(row.count);
    int x = 0;
    for (int k = 0; k < row.count; ++k) {
      const Run& run = image.runs[static_cast<size_t>(row.first + k)];
      ASSERT_EQ(run.begin, x);
      ASSERT_GT(run.end, run.begin);
      ASSERT_LE(run.end, grey.cols);
      for (; x < run.end; ++x) {
        ASSERT_EQ(grey.at<uint8_t>(static_cast<int>(i) * row_step, x) > level, image.is_white(row, k))
            << "at column " << x << " of " << grey.cols << ", row " << i;
      }
    }
    ASSERT_EQ(x, grey.cols);
  }
  EXPECT_EQ(image.runs.size(), next);
}

TEST(ThresholdToRuns, SaysOfEveryPixelWhatAWalkSays) {
  TestRng rng;
  RunImage image;  // its memory goes from picture to picture
  for (int width = 1; width <= 300; ++width) {
    const cv::Mat grey = random_picture(rng, width, 1 + rng.index(6));
    const auto level = static_cast<uint8_t>(rng.index(256));
    const int step = 1 + rng.index(3);
    threshold_to_runs(grey, level, step, image);
    expect_runs_of(grey, level, step, image);
  }
}

TEST(ThresholdToRuns, FollowsLongRunsAcrossTheWordsOf64) {
  RunImage image;
  for (const int width : {1, 2, 15, 16, 17, 63, 64, 65, 127, 128, 129, 192, 300}) {
    for (int begin = 0; begin < width; ++begin) {
      cv::Mat grey(2, width, CV_8UC1, cv::Scalar(10));
      grey(cv::Rect(begin, 0, width - begin, 1)) = 200;
      grey(cv::Rect(0, 1, begin + 1, 1)) = 200;
      threshold_to_runs(grey, 100, 1, image);
      expect_runs_of(grey, 100, 1, image);
      ASSERT_LE(image.runs.size(), 4u);
    }
  }
}

TEST(ThresholdToRuns, CallsWhiteWhatIsAboveTheLevelAndNotWhatIsAtIt) {
  RunImage image;
  for (const int level : {0, 1, 127, 128, 254, 255}) {
    for (const int grey_level : {0, 1, 126, 127, 128, 129, 254, 255}) {
      const cv::Mat grey(1, 81, CV_8UC1, cv::Scalar(grey_level));
      threshold_to_runs(grey, static_cast<uint8_t>(level), 1, image);
      ASSERT_EQ(image.runs.size(), 1u);
      EXPECT_EQ(image.rows[0].first_white, grey_level > level) << grey_level << " at level " << level;
    }
  }
}

TEST(ThresholdToRuns, ReadsAPartOfAPictureAsIfItWereWhole) {
  TestRng rng;
  RunImage of_part, of_copy;
  const cv::Mat around = random_picture(rng, 300, 40);
  for (int i = 0; i < 200; ++i) {
    const int width = 1 + rng.index(200), height = 1 + rng.index(20);
    const cv::Mat part = around(cv::Rect(rng.index(300 - width), rng.index(40 - height), width, height));
    threshold_to_runs(part, 130, 1, of_part);
    expect_runs_of(part, 130, 1, of_part);
  }
}

TEST(LabelAt, IsTheLabelOfTheRunThatHoldsThePixel) {
  TestRng rng;
  RunImage image;
  const cv::Mat grey = random_binary(rng, 100, 5, 0.5);
  threshold_to_runs(grey, 128, 1, image);
  for (size_t i = 0; i < image.runs.size(); ++i) image.runs[i].label = static_cast<int>(i);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 100; ++x) {
      const int label = label_at(image, x, y);
      const auto& row = image.rows[static_cast<size_t>(y)];
      ASSERT_GE(label, row.first);
      ASSERT_LT(label, row.first + row.count);
      const auto& run = image.runs[static_cast<size_t>(label)];
      EXPECT_TRUE(run.begin <= x && x < run.end);
    }
  }
}

}  // namespace
}  // namespace perch
