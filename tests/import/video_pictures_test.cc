#include "perch/import/video_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/videoio.hpp>

#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

fs::path make_video(const TempFolder& folder, int frames) {
  const fs::path file = folder / "video.avi";
  cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {64, 48}, false);
  for (int i = 0; i < frames; ++i) writer.write(cv::Mat(48, 64, CV_8UC1, cv::Scalar(10 * i)));
  return file;
}

template <typename Work>
std::string error_of(const Work& work) {
  try {
    work();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(FrameTimes, AreReadInTheirUnit) {
  const TempFolder folder;
  const auto read = [&](const std::string& text) { return read_frame_times(folder.write("t.csv", text)); };
  EXPECT_THAT(read("#timestamp [ns],filename\n1700000000123456789,a\n1700000000223456789,b\n"),
              ElementsAre(1'700'000'000'123'456'789, 1'700'000'000'223'456'789));
  EXPECT_THAT(read("5\n7\n"), ElementsAre(5, 7));
  EXPECT_THAT(read("timestamp [s],frame\n0.5,0\n0.54,1\n"), ElementsAre(500'000'000, 540'000'000));
  EXPECT_THAT(read("timestamp [us]\n1700000000123456\n"), ElementsAre(1'700'000'000'123'456'000));
  EXPECT_THAT(read("timestamp [ms]\n12.5\n"), ElementsAre(12'500'000));
}

TEST(FrameTimes, ARowWithoutATimeIsAnErrorAsItWouldShiftAllAfterIt) {
  const TempFolder folder;
  const auto error = [&](const std::string& text) {
    return error_of([&] { read_frame_times(folder.write("t.csv", text)); });
  };
  EXPECT_THAT(error("timestamp [ns]\n1\nx\n3\n"),
              HasSubstr("t.csv:3: timestamp: expected a time, found \"x\""));
  EXPECT_THAT(error("timestamp [s]\n1\nnan\n"), HasSubstr("t.csv:3: timestamp: expected a time"));
  EXPECT_THAT(error("timestamp [min]\n1\n"),
              HasSubstr("t.csv:1: expected the column timestamp [ns], found timestamp "
                        "[min]; or [us], [ms], [s]"));
  EXPECT_THAT(error(""), HasSubstr("t.csv: no times"));
}

TEST(FrameTimes, OfTheVideoItselfBeginAtZero) {
  const TempFolder folder;
  EXPECT_THAT(own_frame_times(make_video(folder, 4)), ElementsAre(0, 40'000'000, 80'000'000, 120'000'000));
  EXPECT_THAT(error_of([&] { own_frame_times(folder.write("text.mp4", "hello")); }),
              HasSubstr("text.mp4: no video that can be decoded"));
}

TEST(FrameCount, MustBeThatOfTheTimes) {
  const TempFolder folder;
  const fs::path video = make_video(folder, 4);
  check_frame_count(video, "t.csv", 4);
  EXPECT_THAT(error_of([&] { check_frame_count(video, "t.csv", 5); }),
              HasSubstr("t.csv: 5 times, but " + video.string() + " has 4 frames"));
}

TEST(LinkFile, IsTheSameFileUnlessCopied) {
  const TempFolder folder;
  const fs::path file = folder.write("a", "text");
  link_file(file, folder / "b", false);
  link_file(file, folder / "c", true);
  EXPECT_TRUE(fs::equivalent(file, folder / "b"));
  EXPECT_FALSE(fs::equivalent(file, folder / "c"));
  EXPECT_EQ(read_file(folder / "c"), "text");
  // To another file system, where there is one.
  if (fs::is_directory("/dev/shm")) {
    const fs::path other = "/dev/shm" / folder.path().filename();
    link_file(file, other, false);
    EXPECT_EQ(read_file(other), "text");
    fs::remove(other);
  }
  EXPECT_THAT(error_of([&] { link_file(folder / "none", folder / "d", false); }),
              HasSubstr("none: cannot become"));
  EXPECT_THAT(error_of([&] { link_file(file, folder / "no/folder", false); }), HasSubstr("cannot become"));
}

}  // namespace
}  // namespace perch
