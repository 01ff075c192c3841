#include "perch/camera/v4l2_pixels.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "support/rng.h"

namespace perch {
namespace {

using testing::HasSubstr;

const V4l2PixelFormat* format(const std::string& name) {
  for (const auto* each : v4l2_formats(Channel::kGrey)) {
    if (each->name == name) return each;
  }
  throw std::runtime_error(name);
}

struct Result {
  cv::Mat grey;
  std::string problem;
};
Result convert(const std::string& name, int width, int height, int stride, const std::vector<uint8_t>& bytes,
               Channel channel = Channel::kGrey) {
  Result result;
  cv::Mat scratch;
  result.problem = v4l2_grey({format(name), width, height, stride}, bytes, channel, result.grey, scratch);
  return result;
}

TEST(V4l2Pixels, NamesAndFourCharactersAreTheSame) {
  EXPECT_EQ(fourcc_of("YUYV"), 0x56595559U);
  EXPECT_EQ(fourcc_of("Y10"), 0x20303159U);
  EXPECT_EQ(fourcc_name(0x20303159), "Y10");
  EXPECT_EQ(fourcc_name(0x56595559U | 0x80000000U), "YUYV");
  EXPECT_EQ(fourcc_name(0x01020304), "????");
}

TEST(V4l2Pixels, LumaIsTakenFromWhereItLies) {
  // Two rows of two pixels with grey 1 2, 3 4; rows are padded by 9s.
  const struct {
    const char* name;
    int stride;
    std::vector<uint8_t> bytes;
  } cases[] = {
      {"GREY", 3, {1, 2, 9, 3, 4}},
      {"NV12", 3, {1, 2, 9, 3, 4, 9, 128, 128}},
      {"YU12", 2, {1, 2, 3, 4, 128, 128}},
      {"YUYV", 5, {1, 128, 2, 128, 9, 3, 128, 4, 128}},
      {"UYVY", 4, {128, 1, 128, 2, 128, 3, 128, 4}},
      {"Y10", 4, {4, 0, 8, 0, 12, 0, 16, 0}},
      {"Y12", 4, {16, 0, 32, 0, 48, 0, 64, 0}},
      {"Y16", 5, {77, 1, 77, 2, 9, 77, 3, 77, 4}},
      {"BGR3", 6, {1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4}},
  };
  const cv::Mat expected = (cv::Mat_<uint8_t>(2, 2) << 1, 2, 3, 4);
  for (const auto& c : cases) {
    const Result result = convert(c.name, 2, 2, c.stride, c.bytes);
    EXPECT_EQ(result.problem, "") << c.name;
    EXPECT_EQ(cv::norm(result.grey, expected, cv::NORM_INF), 0) << c.name;
  }
}

TEST(V4l2Pixels, ChannelsOfColour) {
  // BT.601 red: Y 81, U 90, V 240.
  const struct {
    const char* name;
    std::vector<uint8_t> bytes;
    int stride;
  } cases[] = {{"YUYV", {81, 90, 81, 240, 81, 90, 81, 240}, 4},
               {"UYVY", {90, 81, 240, 81, 90, 81, 240, 81}, 4},
               {"NV12", {81, 81, 81, 81, 90, 240}, 2},
               {"NV21", {81, 81, 81, 81, 240, 90}, 2},
               {"RGB3", {255, 0, 0, 255, 0, 0, 255, 0, 0, 255, 0, 0}, 6},
               {"BGR3", {0, 0, 255, 0, 0, 255, 0, 0, 255, 0, 0, 255}, 6}};
  for (const auto& c : cases) {
    EXPECT_NEAR(convert(c.name, 2, 2, c.stride, c.bytes, Channel::kRed).grey.at<uint8_t>(1, 1), 255, 3)
        << c.name;
    EXPECT_NEAR(convert(c.name, 2, 2, c.stride, c.bytes, Channel::kGreen).grey.at<uint8_t>(1, 1), 0, 3)
        << c.name;
    EXPECT_NEAR(convert(c.name, 2, 2, c.stride, c.bytes, Channel::kBlue).grey.at<uint8_t>(1, 1), 0, 3)
        << c.name;
  }
  for (const auto* each : v4l2_formats(Channel::kRed)) EXPECT_STRNE(each->name, "GREY");
}

std::vector<uint8_t> jpeg(int width, int height) {
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", cv::Mat(height, width, CV_8UC3, cv::Scalar(20, 20, 200)), bytes);
  return bytes;
}

TEST(V4l2Pixels, JpegsAreDecodedOrSayWhyNot) {
  std::vector<uint8_t> bytes = jpeg(16, 8);
  EXPECT_NEAR(convert("MJPG", 16, 8, 0, bytes).grey.at<uint8_t>(3, 3), 74,
              2);  // 0.114 20 + 0.587 20 + 0.299 200
  EXPECT_NEAR(convert("MJPG", 16, 8, 0, bytes, Channel::kRed).grey.at<uint8_t>(3, 3), 200, 4);
  bytes.resize(bytes.size() + 100);  // cameras fill their buffers up
  EXPECT_EQ(convert("MJPG", 16, 8, 0, bytes).problem, "");
  EXPECT_EQ(convert("MJPG", 8, 8, 0, bytes).problem, "a picture of 16x8 in a stream of 8x8");
  EXPECT_EQ(convert("MJPG", 16, 8, 0, {1, 2, 3, 4}).problem, "no JPEG");
  EXPECT_EQ(convert("MJPG", 16, 8, 0, {}).problem, "no JPEG");
  bytes = jpeg(16, 8);
  bytes.resize(bytes.size() / 2);
  EXPECT_EQ(convert("MJPG", 16, 8, 0, bytes).problem, "truncated");
}

// No bytes can do harm: any length of any format, and JPEGs with any byte changed.
TEST(V4l2Pixels, NoBytesDoHarm) {
  TestRng rng;
  for (const Channel channel : {Channel::kGrey, Channel::kGreen}) {
    for (const auto* each : v4l2_formats(channel)) {
      for (size_t length = 0; length < 700; ++length) {
        const std::vector<uint8_t> bytes(length, static_cast<uint8_t>(rng.index(256)));
        const Result result = convert(each->name, 16, 8, 16 * std::max(1, each->bytes_pixel), bytes, channel);
        if (!result.problem.empty()) continue;
        EXPECT_EQ(result.grey.size(), cv::Size(16, 8)) << each->name;
        EXPECT_GE(length, 16U * 8U) << each->name;
      }
    }
    const std::vector<uint8_t> whole = jpeg(16, 8);
    for (int i = 0; i < 3000; ++i) {
      std::vector<uint8_t> bytes = whole;
      for (int n = rng.index(3); n >= 0; --n) {
        bytes[static_cast<size_t>(rng.index(static_cast<int>(bytes.size())))] =
            static_cast<uint8_t>(rng.index(256));
      }
      const Result result = convert("MJPG", 16, 8, 0, bytes, channel);
      if (result.problem.empty()) {
        EXPECT_EQ(result.grey.size(), cv::Size(16, 8));
      }
    }
  }
}

}  // namespace
}  // namespace perch
