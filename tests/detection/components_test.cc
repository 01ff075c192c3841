#include "perch/detection/components.h"

#include <map>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "support/random_picture.h"

namespace perch {
namespace {

// What the paper describes, done the plain way: a black frame of one pixel around the picture, then each
// region filled from its first pixel by 4-connectivity. Region 0 is the frame's.
struct Filled {
  cv::Mat label;  // CV_32SC1, the picture's size
  std::vector<Component> regions;
};

void fill_from(const cv::Mat& framed, cv::Mat& label, cv::Point start, int region) {
  const uint8_t colour = framed.at<uint8_t>(start);
  std::vector<cv::Point> open{start};
  label.at<int>(start) = region;
  while (!open.empty()) {
    const cv::Point p = open.back();
    open.pop_back();
    for (const cv::Point step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const cv::Point q = p + step;
      if (!cv::Rect({}, framed.size()).contains(q)) continue;
      if (framed.at<uint8_t>(q) != colour || label.at<int>(q) >= 0) continue;
      label.at<int>(q) = region;
      open.push_back(q);
    }
  }
}

Filled flood_fill(const cv::Mat& binary) {
  cv::Mat framed;
  cv::copyMakeBorder(binary, framed, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::Mat label(framed.size(), CV_32SC1, cv::Scalar(-1));
  int count = 0;
  for (int y = 0; y < framed.rows; ++y) {
    for (int x = 0; x < framed.cols; ++x) {
      if (label.at<int>(y, x) < 0) fill_from(framed, label, {x, y}, count++);
    }
  }
  Filled filled{label(cv::Rect(1, 1, binary.cols, binary.rows)).clone(), {}};
  filled.regions.resize(static_cast<size_t>(count), {0, 0, binary.cols, binary.rows, -1, -1, -1, false});
  for (int y = 0; y < binary.rows; ++y) {
    for (int x = 0; x < binary.cols; ++x) {
      Component& c = filled.regions[static_cast<size_t>(filled.label.at<int>(y, x))];
      ++c.area;
      c.left = std::min(c.left, x);
      c.right = std::max(c.right, x);
      c.top = std::min(c.top, y);
      c.bottom = std::max(c.bottom, y);
      c.white = binary.at<uint8_t>(y, x) != 0;
    }
  }
  return filled;
}

void expect_as_filled(const cv::Mat& binary, const std::string& what) {
  SCOPED_TRACE(what);
  RunImage image, foreground;
  Components components;
  threshold_to_runs(binary, 128, 1, image);
  label_components(image, components);
  const Filled filled = flood_fill(binary);

  std::map<int, int> region_of{{Components::kFrame, 0}}, label_of{{0, Components::kFrame}};
  for (int y = 0; y < binary.rows; ++y) {
    for (int x = 0; x < binary.cols; ++x) {
      const int label = label_at(image, x, y);
      const int region = filled.label.at<int>(y, x);
      ASSERT_TRUE(components.is_root(label));
      // One to one: the same partition, whatever the names.
      ASSERT_EQ(region_of.try_emplace(label, region).first->second, region) << "at " << x << ", " << y;
      ASSERT_EQ(label_of.try_emplace(region, label).first->second, label) << "at " << x << ", " << y;
    }
  }
  for (size_t label = 0; label < components.list.size(); ++label) {
    const bool root = components.is_root(static_cast<int>(label));
    ASSERT_EQ(root, region_of.contains(static_cast<int>(label)));
    if (!root) continue;
    const Component& c = components.list[label];
    const Component& expected = filled.regions[static_cast<size_t>(region_of[static_cast<int>(label)])];
    ASSERT_EQ(c.area, expected.area);
    ASSERT_EQ(c.left, expected.left);
    ASSERT_EQ(c.right, expected.right);
    ASSERT_EQ(c.top, expected.top);
    ASSERT_EQ(c.bottom, expected.bottom);
    ASSERT_EQ(c.white, expected.white);
    if (label == Components::kFrame) continue;
    const auto& first = image.runs[static_cast<size_t>(c.first_run)];
    ASSERT_EQ(first.label, static_cast<int>(label));
    int column = c.left;  // of the first pixel of the region's top row
    while (filled.label.at<int>(c.top, column) != region_of[static_cast<int>(label)]) ++column;
    ASSERT_EQ(first.begin, column);
  }

  foreground_runs(image, foreground);
  ASSERT_EQ(foreground.rows.size(), static_cast<size_t>(binary.rows));
  for (int y = 0; y < binary.rows; ++y) {
    const auto& row = foreground.rows[static_cast<size_t>(y)];
    int x = 0;
    for (int k = 0; k < row.count; ++k) {
      const Run& run = foreground.runs[static_cast<size_t>(row.first + k)];
      ASSERT_EQ(run.begin, x);
      ASSERT_GT(run.end, x);
      for (; x < run.end; ++x) ASSERT_EQ(foreground.is_white(row, k), filled.label.at<int>(y, x) != 0);
    }
    ASSERT_EQ(x, binary.cols);
  }
}

TEST(LabelComponents, AgreesWithAFloodFillOnNoiseOfEveryDensity) {
  TestRng rng;
  for (const double density : {0.0, 0.02, 0.2, 0.4, 0.5, 0.6, 0.8, 0.98, 1.0}) {
    for (int i = 0; i < 30; ++i) {
      expect_as_filled(random_binary(rng, 1 + rng.index(90), 1 + rng.index(60), density),
                       "density " + std::to_string(density) + ", picture " + std::to_string(i));
    }
  }
}

TEST(LabelComponents, AgreesWithAFloodFillOnBlobs) {
  TestRng rng;
  for (int i = 0; i < 40; ++i) {
    cv::Mat grey = random_picture(rng, 100, 80);
    cv::GaussianBlur(grey, grey, {}, rng.uniform(1, 5));
    cv::threshold(grey, grey, cv::mean(grey)[0], 255, cv::THRESH_BINARY);
    expect_as_filled(grey, "picture " + std::to_string(i));
  }
}

TEST(LabelComponents, AgreesWithAFloodFillOnLinesOfOnePixel) {
  TestRng rng;
  for (int length = 1; length <= 70; ++length) {
    expect_as_filled(random_binary(rng, length, 1, 0.5), "a row");
    expect_as_filled(random_binary(rng, 1, length, 0.5), "a column");
  }
  expect_as_filled(cv::Mat(1, 1, CV_8UC1, cv::Scalar(0)), "one black pixel");
  expect_as_filled(cv::Mat(1, 1, CV_8UC1, cv::Scalar(255)), "one white pixel");
}

TEST(LabelComponents, KeepsTheFieldsOfACheckerboardApart) {
  cv::Mat board(21, 33, CV_8UC1);
  for (int y = 0; y < board.rows; ++y) {
    for (int x = 0; x < board.cols; ++x) board.at<uint8_t>(y, x) = (x + y) % 2 == 0 ? 255 : 0;
  }
  expect_as_filled(board, "white corners");
  expect_as_filled(255 - board, "black corners");
}

// Combs make each tooth a region of its own until the last row joins them all; a spiral joins them one by one
// and from both sides. Both were chosen against a union-find that forgets.
TEST(LabelComponents, JoinsCombsAndSpirals) {
  cv::Mat comb(30, 61, CV_8UC1, cv::Scalar(0));
  for (int x = 1; x < 60; x += 2) comb(cv::Rect(x, 1, 1, 28)) = 255;
  comb(cv::Rect(1, 28, 59, 1)) = 255;
  cv::Mat other;
  for (const bool inverted : {false, true}) {
    const cv::Mat teeth = inverted ? cv::Mat(255 - comb) : comb;
    expect_as_filled(teeth, "teeth up");
    cv::flip(teeth, other, 0);
    expect_as_filled(other, "teeth down");
    expect_as_filled(teeth.t(), "teeth left");
  }

  cv::Mat spiral(41, 41, CV_8UC1, cv::Scalar(0));
  cv::Point p(20, 20);
  for (int turn = 0, length = 2; length < 40; ++turn) {
    const cv::Point step[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    for (int i = 0; i < length; ++i) spiral.at<uint8_t>(p += step[turn % 4]) = 255;
    if (turn % 2 == 1) length += 2;
  }
  for (int flip = 0; flip < 4; ++flip) {
    cv::rotate(spiral, spiral, cv::ROTATE_90_CLOCKWISE);
    expect_as_filled(spiral, "spiral");
    expect_as_filled(255 - spiral, "black spiral");
  }
}

TEST(LabelComponents, JoinsBlackRegionsThroughTheFrame) {
  // A white band from edge to edge: the black above and below are one background.
  cv::Mat band(30, 40, CV_8UC1, cv::Scalar(0));
  band(cv::Rect(0, 10, 40, 10)) = 255;
  expect_as_filled(band, "band");
  RunImage image;
  Components components;
  threshold_to_runs(band, 128, 1, image);
  label_components(image, components);
  EXPECT_EQ(label_at(image, 20, 0), Components::kFrame);
  EXPECT_EQ(label_at(image, 20, 29), Components::kFrame);
  EXPECT_NE(label_at(image, 20, 15), Components::kFrame);
}

TEST(Surrounding, ClimbsFromRingToRing) {
  cv::Mat rings(60, 60, CV_8UC1, cv::Scalar(0));
  for (int i = 1; i <= 5; ++i) {
    cv::circle(rings, {30, 30}, 29 - 5 * i, cv::Scalar(i % 2 == 1 ? 255 : 0), cv::FILLED);
  }
  RunImage image;
  Components components;
  threshold_to_runs(rings, 128, 1, image);
  label_components(image, components);
  int label = label_at(image, 30, 30);
  for (int x = 30 - 4 - 3; x >= 0; x -= 5) {
    label = surrounding(image, components.list[static_cast<size_t>(label)]);
    EXPECT_EQ(label, label_at(image, x, 30)) << "at column " << x;
    if (label == Components::kFrame) break;
  }
  EXPECT_EQ(label, Components::kFrame);
}

}  // namespace
}  // namespace perch
