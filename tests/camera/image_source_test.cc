#include "perch/camera/image_source.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "perch/camera/picture_source.h"
#include "support/rng.h"
#include "support/shared.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::ThrowsMessage;

cv::Mat noise(int type, int width = 64, int height = 48) {
  cv::Mat picture(height, width, type);
  cv::RNG rng(42);
  rng.fill(picture, cv::RNG::UNIFORM, 0, picture.depth() == CV_8U ? 256 : 65536);
  return picture;
}

std::string encoded(const std::string& extension, const cv::Mat& picture,
                    const std::vector<int>& options = {}) {
  std::vector<uint8_t> bytes;
  EXPECT_TRUE(cv::imencode(extension, picture, bytes, options));
  return {bytes.begin(), bytes.end()};
}

Frame read(const fs::path& file, Channel channel = Channel::kGrey) {
  Frame frame;
  read_picture(file, channel, frame);
  EXPECT_EQ(frame.grey.empty(), !frame.problem.empty()) << frame.problem;
  if (!frame.grey.empty()) {
    EXPECT_EQ(frame.grey.type(), CV_8UC1);
    EXPECT_TRUE(frame.grey.isContinuous());
  }
  return frame;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

TEST(ReadPicture, GreyComesAsItIs) {
  const TempFolder folder;
  const cv::Mat grey = noise(CV_8UC1);
  EXPECT_TRUE(same(read(folder.write("a.png", encoded(".png", grey))).grey, grey));
  EXPECT_TRUE(same(read(folder.write("a.pgm", encoded(".pgm", grey))).grey, grey));
  const Frame jpeg = read(folder.write("a.jpg", encoded(".jpg", cv::Mat(48, 64, CV_8UC1, cv::Scalar(77)))));
  EXPECT_TRUE(same(jpeg.grey, cv::Mat(48, 64, CV_8UC1, cv::Scalar(77))));
}

TEST(ReadPicture, ColourIsWeighedOrOneChannel) {
  const TempFolder folder;
  const cv::Mat colour(8, 8, CV_8UC3, cv::Scalar(10, 100, 200));  // blue, green, red
  const cv::Mat nearly_clear(8, 8, CV_8UC4, cv::Scalar(10, 100, 200, 3));
  for (const cv::Mat& picture : {colour, nearly_clear}) {
    const auto file = folder.write("a.png", encoded(".png", picture));
    EXPECT_EQ(read(file).grey.at<uint8_t>(3, 3), 120);  // 0.114 * 10 + 0.587 * 100 + 0.299 * 200 = 119.6
    EXPECT_EQ(read(file, Channel::kRed).grey.at<uint8_t>(3, 3), 200);
    EXPECT_EQ(read(file, Channel::kGreen).grey.at<uint8_t>(3, 3), 100);
    EXPECT_EQ(read(file, Channel::kBlue).grey.at<uint8_t>(3, 3), 10);
  }
}

TEST(ReadPicture, SingleBitsAreTaken) {
  const TempFolder folder;
  cv::Mat bits = noise(CV_8UC1) > 127;
  const auto file = folder.write("bits.png", encoded(".png", bits, {cv::IMWRITE_PNG_BILEVEL, 1}));
  EXPECT_TRUE(same(read(file).grey, bits));
}

TEST(ReadPicture, SixteenBitsAreCutToTheBitsInUse) {
  const TempFolder folder;
  const cv::Mat deep = noise(CV_16UC1);
  for (const auto& [bits, shift] : {std::pair{16, 8}, {14, 6}, {12, 4}, {10, 2}, {8, 0}}) {
    cv::Mat used(deep.size(), CV_16UC1), expected(deep.size(), CV_8UC1);
    for (int i = 0; i < deep.rows * deep.cols; ++i) {
      used.ptr<uint16_t>()[i] = static_cast<uint16_t>(deep.ptr<uint16_t>()[i] >> (16 - bits));
      expected.ptr<uint8_t>()[i] = static_cast<uint8_t>(used.ptr<uint16_t>()[i] >> shift);
    }
    EXPECT_TRUE(same(read(folder.write("a.png", encoded(".png", used))).grey, expected)) << bits;
    EXPECT_TRUE(same(read(folder.write("a.pgm", encoded(".pgm", used))).grey, expected)) << bits;
  }
  const Frame colour =
      read(folder.write("c.png", encoded(".png", cv::Mat(4, 4, CV_16UC3, cv::Scalar(0, 0, 51200)))),
           Channel::kRed);
  EXPECT_EQ(colour.grey.at<uint8_t>(0, 0), 200);
}

// Wherever a picture is cut, nothing but the cause comes back.
TEST(ReadPicture, EveryCutIsNoticed) {
  const TempFolder folder;
  TestRng rng;
  for (const char* extension : {".png", ".jpg", ".pgm", ".ppm"}) {
    for (const int type : {CV_8UC1, CV_8UC3}) {
      if (extension == std::string(".pgm") && type == CV_8UC3) continue;
      if (extension == std::string(".ppm") && type == CV_8UC1) continue;
      const std::string whole = encoded(extension, noise(type));
      ASSERT_EQ(read(folder.write(std::string("a") + extension, whole)).problem, "");
      std::vector<size_t> lengths{whole.size() - 1, whole.size() - 2, 1, 3, 9};
      for (int i = 0; i < 30; ++i)
        lengths.push_back(static_cast<size_t>(rng.index(static_cast<int>(whole.size()))));
      for (const size_t length : lengths) {
        const Frame frame = read(folder.write(std::string("a") + extension, whole.substr(0, length)));
        EXPECT_NE(frame.problem, "") << extension << " cut to " << length << " of " << whole.size();
        if (length > 100) {
          EXPECT_THAT(frame.problem, EndsWith(std::string("a") + extension + ": truncated"));
        }
      }
    }
  }
}

TEST(ReadPicture, ProgressiveJpegsAndTrailingBytesAreTaken) {
  const TempFolder folder;
  const std::string jpeg =
      encoded(".jpg", noise(CV_8UC3), {cv::IMWRITE_JPEG_PROGRESSIVE, 1, cv::IMWRITE_JPEG_RST_INTERVAL, 2});
  EXPECT_EQ(read(folder.write("a.jpg", jpeg)).problem, "");
  EXPECT_EQ(read(folder.write("a.jpg", jpeg + std::string(100, '\0'))).problem, "");
  EXPECT_EQ(read(folder.write("a.jpg", jpeg + "appended by a camera")).problem, "");
  EXPECT_THAT(read(folder.write("a.jpg", jpeg.substr(0, jpeg.size() - 2) + std::string(100, '\0'))).problem,
              HasSubstr("truncated"));
  EXPECT_EQ(read(folder.write("a.png", encoded(".png", noise(CV_8UC1)) + "more")).problem, "");
}

TEST(ReadPicture, SaysWhatIsWrong) {
  const TempFolder folder;
  EXPECT_THAT(read(folder / "absent.png").problem, EndsWith("absent.png: no such file"));
  EXPECT_THAT(read(folder.path()).problem, EndsWith(": cannot be read"));
  EXPECT_THAT(read(folder.write("a.png", "")).problem, EndsWith("a.png: empty"));
  EXPECT_THAT(read(folder.write("a.png", "this is a text")).problem,
              EndsWith("no picture that can be decoded"));
  std::string png = encoded(".png", noise(CV_8UC1));
  png[png.size() / 2] = static_cast<char>(png[png.size() / 2] ^ 1);
  EXPECT_THAT(read(folder.write("a.png", png)).problem, EndsWith("a.png: damaged"));
}

TEST(ReadPicture, HugeClaimsAreRefusedUnread) {
  const TempFolder folder;
  EXPECT_THAT(read(folder.write("a.pgm", "P5 200000 200000 255\n")).problem,
              EndsWith("too large: 200000 x 200000"));
  EXPECT_THAT(read(folder.write("a.pgm", "P5 99999999999999999999 2 255\n")).problem, HasSubstr("a.pgm: "));
  EXPECT_THAT(read(folder.write("a.pgm", "P5 0 2 255\n")).problem, EndsWith("a picture without pixels"));
  std::string jpeg = encoded(".jpg", noise(CV_8UC1));
  const size_t frame = jpeg.find("\xFF\xC0");
  ASSERT_NE(frame, std::string::npos);
  for (size_t i = 5; i < 9; ++i) jpeg[frame + i] = '\xFF';
  EXPECT_THAT(read(folder.write("a.jpg", jpeg)).problem, EndsWith("too large: 65535 x 65535"));
}

std::vector<Frame> all(ImageSource& source) {
  std::vector<Frame> frames;
  for (Frame frame; source.next(frame);) frames.push_back(frame);
  return frames;
}

TEST(NaturalOrder, GoesByTheValueOfNumbers) {
  std::vector<std::string> names{"b1", "a10", "a9", "a010b", "a", "a10b", "a9b"};
  std::sort(names.begin(), names.end(), natural_less);
  EXPECT_THAT(names, ElementsAre("a", "a9", "a9b", "a10", "a010b", "a10b", "b1"));
}

TEST(ImagesSource, SortsNaturallyAndTakesTimesFromNames) {
  const TempFolder folder;
  const std::string png = encoded(".png", noise(CV_8UC1));
  for (const char* name : {"few/10.png", "few/9.png", "few/1.png", "ns/1700000000100000000.png",
                           "ns/1700000000000000000.png", "ns/notes.txt"}) {
    folder.write(name, png);
  }
  const auto few = open_image_source("images:" + (folder / "few/*.png").string());
  EXPECT_EQ(few->size(), 3);
  const auto frames = all(*few);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(frames[1].name, "9.png");
  EXPECT_EQ(frames[2].name, "10.png");
  EXPECT_EQ(frames[2].timestamp_ns, 2 * 33'333'333);
  const auto named = all(*open_image_source("images:" + (folder / "ns/*.png").string()));
  ASSERT_EQ(named.size(), 2U);
  EXPECT_EQ(named[0].timestamp_ns, 1700000000000000000);
  EXPECT_EQ(named[1].timestamp_ns, 1700000000100000000);
  EXPECT_THAT([&] { open_image_source("images:" + (folder / "none/*.png").string()); },
              ThrowsMessage<std::runtime_error>(EndsWith("none/*.png: no file matches")));
}

TEST(FlightSource, KeepsARowForEveryPictureAndSkipsRowsWithoutATime) {
  const TempFolder folder;
  const std::string png = encoded(".png", noise(CV_8UC1));
  folder.write("mav0/cam0/data/1.png", png);
  folder.write("mav0/cam0/data/cut.png", png.substr(0, 500));
  folder.write("mav0/cam0/data/last.png", png);
  const auto csv = folder.write("mav0/cam0/data.csv",
                                "#timestamp [ns],filename\r\n"
                                "1000,1.png\r\n"
                                "nan,1.png\r\n"
                                "1100,absent.png\r\n"
                                "1150\r\n"
                                "1200,cut.png\r\n"
                                "1200,1.png\r\n"
                                "900,1.png\r\n"
                                "\r\n"
                                "1.3e3,1.png\r\n"
                                "1400,last.png");
  const auto source = open_image_source("flight:" + folder.path().string());
  const auto frames = all(*source);
  ASSERT_EQ(frames.size(), 4U);
  EXPECT_EQ(source->size(), 4);
  EXPECT_EQ(frames[0].timestamp_ns, 1000);
  EXPECT_EQ(frames[0].name, "1.png");
  EXPECT_EQ(frames[0].problem, "");
  EXPECT_THAT(frames[1].problem, EndsWith("data/absent.png: no such file"));
  EXPECT_THAT(frames[2].problem, EndsWith("data/cut.png: truncated"));
  EXPECT_EQ(frames[3].timestamp_ns, 1400);
  EXPECT_FALSE(frames[3].grey.empty());
  const std::string place = csv.string() + ":";
  EXPECT_THAT(source->problems(),
              ElementsAre(place + "3: timestamp: expected whole nanoseconds, found \"nan\", row skipped",
                          place + "5: filename: found none, row skipped",
                          place + "10: timestamp: expected whole nanoseconds, found \"1.3e3\", row skipped",
                          place + "7: the clock goes back or stands still at 1200, row skipped",
                          place + "8: the clock goes back or stands still at 900, row skipped"));
}

TEST(FlightSource, SaysWhenAFolderIsNoFlight) {
  const TempFolder folder;
  EXPECT_THAT([&] { open_image_source("flight:" + folder.path().string()); },
              ThrowsMessage<std::runtime_error>(EndsWith("no flight: expected mav0/cam0/data.csv in it")));
  folder.write("mav0/cam0/data.csv", "#timestamp [s],filename\n1.5,1.png\n");
  EXPECT_THAT([&] { open_image_source("flight:" + folder.path().string()); },
              ThrowsMessage<std::runtime_error>(
                  HasSubstr("expected the column timestamp [ns], found timestamp [s]")));
  EXPECT_THROW(open_image_source("flight:"), std::runtime_error);
  EXPECT_THAT(
      [&] { open_image_source("camera7"); },
      ThrowsMessage<std::runtime_error>("camera7: expected flight:FOLDER, images:GLOB or video:FILE"));
}

// Ten frames of one grey level each, 20 n, without loss; false where this FFmpeg cannot.
bool write_video(const fs::path& file) {
  cv::VideoWriter writer(file.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('F', 'F', 'V', '1'), 20,
                         {64, 48});
  for (int i = 0; i < 10; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(20 * i)));
  return writer.isOpened();
}

TEST(VideoSource, GivesItsFramesInOrderWithTheirTimes) {
  const TempFolder folder;
  if (!write_video(folder / "a.mkv")) GTEST_SKIP() << "this OpenCV writes no FFV1";
  const auto source = open_image_source("video:" + (folder / "a.mkv").string());
  const auto frames = all(*source);
  ASSERT_EQ(frames.size(), 10U);
  for (size_t i = 0; i < frames.size(); ++i) {
    EXPECT_NEAR(frames[i].grey.at<uint8_t>(5, 5), 20 * static_cast<double>(i), 2);  // through YUV and back
    EXPECT_EQ(frames[i].timestamp_ns, static_cast<int64_t>(i) * 50'000'000);
    EXPECT_EQ(frames[i].name, "a.mkv#" + std::to_string(i));
  }
  EXPECT_THAT([&] { open_image_source("video:" + (folder / "absent.mkv").string()); },
              ThrowsMessage<std::runtime_error>(EndsWith("absent.mkv: no such file")));
  EXPECT_THAT([&] { open_image_source("video:" + folder.write("text.mkv", "text").string()); },
              ThrowsMessage<std::runtime_error>(EndsWith("text.mkv: no video that can be decoded")));
}

TEST(VideoSource, CutFileGivesWhatItHasAndSaysSo) {
  const TempFolder folder;
  if (!write_video(folder / "a.mkv")) GTEST_SKIP() << "this OpenCV writes no FFV1";
  const std::string whole = read_file(folder / "a.mkv");
  const auto source =
      open_image_source("video:" + folder.write("cut.mkv", whole.substr(0, whole.size() / 2)).string());
  EXPECT_LT(all(*source).size(), 10U);
}

TEST(FlightSource, RowsOfAVideoAreItsFrames) {
  const TempFolder folder;
  fs::create_directories(folder / "mav0/cam0");
  if (!write_video(folder / "mav0/cam0/data.mkv")) GTEST_SKIP() << "this OpenCV writes no FFV1";
  std::string csv = "#timestamp [ns],filename\n";
  for (int i = 0; i < 12; ++i) csv += (i == 3 ? "bad" : std::to_string(1000 + i)) + "\n";
  folder.write("mav0/cam0/data.csv", csv);
  const auto source = open_image_source("flight:" + folder.path().string());
  const auto frames = all(*source);
  ASSERT_EQ(frames.size(), 11U);
  EXPECT_EQ(frames[3].timestamp_ns, 1004);  // a bad row takes its frame with it
  EXPECT_NEAR(frames[3].grey.at<uint8_t>(5, 5), 80, 2);
  EXPECT_EQ(frames[3].name, "data.mkv#4");
  EXPECT_THAT(frames[9].problem, EndsWith("data.mkv: ends before frame 10"));
  EXPECT_EQ(source->problems().size(), 1U);
}

TEST(FlightSource, FramesKeepTheirPicturesWhenTheNextIsRead) {
  const TempFolder folder;
  for (int i = 1; i < 3; ++i) {
    folder.write("mav0/cam0/data/" + std::to_string(i) + ".png",
                 encoded(".png", cv::Mat(4, 4, CV_8UC3, cv::Scalar::all(i))));
  }
  folder.write("mav0/cam0/data.csv", "1,1.png\n2,2.png\n");
  const auto source = open_image_source("flight:" + folder.path().string());
  Frame frame;
  ASSERT_TRUE(source->next(frame));
  const cv::Mat first = frame.grey;
  ASSERT_TRUE(source->next(frame));
  EXPECT_EQ(first.at<uint8_t>(0, 0), 1);
}

TEST(FlightSource, ReadsTheDevelopmentFlights) {
  for (const auto& [name, count] : {std::pair{"dev_negative", 20}, {"real_mocap", 15}, {"real_photos", 4}}) {
    const auto flight = shared_flight(name);
    if (flight.empty()) GTEST_SKIP() << "no development flights here";
    const auto source = open_image_source("flight:" + flight.string());
    const auto frames = all(*source);
    EXPECT_EQ(frames.size(), static_cast<size_t>(count)) << name;
    for (const auto& frame : frames) EXPECT_EQ(frame.problem, "");
    EXPECT_THAT(source->problems(), ElementsAre());
  }
}

}  // namespace
}  // namespace perch
