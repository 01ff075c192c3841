// With the real GStreamer: its test source, and a camera on the network made of it.

#include "perch/camera/gst_device.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <thread>

#include "camera/rtp_sender.h"
#include "support/config_error.h"

namespace perch {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;

constexpr int64_t kMs = 1'000'000;
const std::string kSmall = " ! video/x-raw,width=64,height=48,framerate=50/1";

std::unique_ptr<LiveSource> open(const std::string& pipeline, const LiveOptions& options = {},
                                 Channel channel = Channel::kGrey) {
  return open_live_source("gst:" + pipeline, options, channel);
}

// A machine that stands still for a moment is no camera that stopped.
LiveOptions patient() {
  LiveOptions options;
  options.stall = 10;
  return options;
}

// The pictures of the next while, their pixels kept.
std::vector<LiveFrame> watch(LiveSource& source, milliseconds duration, size_t at_most = 1000) {
  std::vector<LiveFrame> pictures;
  const int64_t end = camera_now_ns() + std::chrono::nanoseconds(duration).count();
  while (camera_now_ns() < end && pictures.size() < at_most) {
    if (auto picture = source.next(milliseconds(20))) {
      picture->frame.grey = picture->frame.grey.clone();
      pictures.push_back(*picture);
    }
  }
  return pictures;
}

// The middle one: a machine that is busy elsewhere makes single pictures late.
int64_t median(std::vector<int64_t> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

TEST(GstDevice, GivesALivePipelinesPicturesWithTheirTimes) {
  const auto source = open("videotestsrc is-live=true pattern=white" + kSmall, patient());
  const auto pictures = watch(*source, seconds(10), 25);
  ASSERT_EQ(pictures.size(), 25U);
  EXPECT_EQ(source->counters().last_problem, "");
  std::vector<int64_t> ages;
  for (size_t i = 0; i < pictures.size(); ++i) {
    const Frame& frame = pictures[i].frame;
    ASSERT_EQ(frame.grey.size(), cv::Size(64, 48));
    EXPECT_TRUE(frame.grey.isContinuous());
    EXPECT_GE(frame.grey.at<uint8_t>(20, 20), 235);
    ages.push_back(pictures[i].arrived_ns - frame.timestamp_ns);
    if (i == 0) continue;
    // Stamps are multiples of the period, whenever the pictures come.
    const int64_t periods = (frame.timestamp_ns - pictures[i - 1].frame.timestamp_ns + 10 * kMs) / (20 * kMs);
    EXPECT_NEAR(static_cast<double>(frame.timestamp_ns - pictures[i - 1].frame.timestamp_ns),
                static_cast<double>(periods * 20 * kMs), 1e5);
  }
  // The test source gives a picture when its time has come, and nobody waits for anything then.
  EXPECT_GE(median(ages), 0);
  EXPECT_LE(median(ages), 15 * kMs);
}

TEST(GstDevice, AMistakeInThePipelineIsSaidAtOnce) {
  EXPECT_THAT(
      config_error([] { open("nosuchsrc ! videorate"); }),
      AllOf(HasSubstr("camera.source: gst:nosuchsrc ! videorate: "), HasSubstr("no element \"nosuchsrc\"")));
  EXPECT_THAT(config_error([] { open("videotestsrc colour=blue"); }), HasSubstr("no property \"colour\""));
  EXPECT_THAT(config_error([] { open("videotestsrc ! fakesink"); }), HasSubstr("could not link"));
  EXPECT_THAT(config_error([] { open("videotestsrc ! ! x"); }), HasSubstr("syntax error"));
  EXPECT_THAT(config_error([] { open("audiotestsrc"); }), HasSubstr("could not link"));
  LiveOptions options;
  options.exposure = 0.004;
  EXPECT_THAT(config_error([&] { open("videotestsrc", options); }), HasSubstr("for v4l2 sources"));
}

TEST(GstDevice, WhatIsNotThereIsTriedAgainAndSaid) {
  const auto source = open("filesrc location=/nowhere/film.avi ! decodebin");
  for (int i = 0; i < 100 && source->counters().open_failed < 2; ++i)
    EXPECT_TRUE(watch(*source, milliseconds(100)).empty());
  EXPECT_GE(source->counters().open_failed, 2);
  EXPECT_THAT(source->counters().last_problem, AllOf(HasSubstr("film.avi"), HasSubstr("No such file")));
}

TEST(GstDevice, AStreamThatEndsOrFailsIsOpenedAnew) {
  for (const char* trouble : {"num-buffers=5", "! identity error-after=5"}) {
    const auto source = open(std::string("videotestsrc is-live=true ") + trouble + kSmall, patient());
    const auto pictures = watch(*source, seconds(20), 12);
    EXPECT_EQ(pictures.size(), 12U) << trouble;
    EXPECT_GE(source->counters().reopened, 2) << trouble;
    EXPECT_THAT(source->counters().last_problem,
                HasSubstr(trouble[0] == '!' ? ": Failed after iterations as requested" : "stream ended"));
    std::vector<int64_t> ages;
    for (size_t i = 0; i < pictures.size(); ++i) {
      ages.push_back(pictures[i].arrived_ns - pictures[i].frame.timestamp_ns);
      if (i == 0) continue;
      EXPECT_GT(pictures[i].frame.timestamp_ns, pictures[i - 1].frame.timestamp_ns);
    }
    ASSERT_FALSE(ages.empty());
    EXPECT_LT(median(ages), 500 * kMs);
  }
}

TEST(GstDevice, WhatIsNotLiveIsPlayedInRealTime) {
  // More than are asked for: some are lost to whoever comes late.
  const auto source = open("videotestsrc num-buffers=500" + kSmall, patient());
  const int64_t start = camera_now_ns();
  EXPECT_GE(watch(*source, seconds(10), 15).size(), 15U);
  EXPECT_EQ(source->counters().reopened, 0);
  EXPECT_GE(camera_now_ns() - start, 14 * 20 * kMs);  // without: in a moment
}

TEST(GstDevice, ASizeThatIsDemandedIsKept) {
  LiveOptions options;
  options.width = 32;
  options.height = 24;
  const auto chosen = watch(*open("videotestsrc is-live=true", options), seconds(10), 1);
  ASSERT_EQ(chosen.size(), 1U);
  EXPECT_EQ(chosen[0].frame.grey.size(), cv::Size(32, 24));
  EXPECT_THAT(config_error([&] { open("videotestsrc is-live=true" + kSmall, options); }),
              HasSubstr("can't handle caps video/x-raw, format=(string)GRAY8, width=(int)32"));
}

TEST(GstDevice, OneChannelOfColour) {
  for (const auto& [channel, grey] :
       {std::pair{Channel::kRed, 255}, {Channel::kGreen, 0}, {Channel::kBlue, 0}}) {
    const auto source = open("videotestsrc is-live=true pattern=red" + kSmall, {}, channel);
    const auto pictures = watch(*source, seconds(10), 1);
    ASSERT_EQ(pictures.size(), 1U);
    EXPECT_NEAR(pictures[0].frame.grey.at<uint8_t>(7, 7), grey, 5);  // by way of YUV
  }
}

TEST(GstDevice, WhoIsSlowGetsTheNewestAndTheRestIsCounted) {
  const auto source = open("videotestsrc is-live=true" + kSmall, patient());
  int64_t dropped = 0, age = 0;
  // Several times: on a busy machine the newest itself may come late.
  for (int i = 0; i < 5 && (dropped < 12 || age >= 150 * kMs); ++i) {
    const auto before = watch(*source, seconds(10), 3);
    ASSERT_EQ(before.size(), 3U);
    const int64_t dropped_before = source->counters().dropped;
    std::this_thread::sleep_for(milliseconds(400));
    const auto after = watch(*source, seconds(10), 2);
    ASSERT_EQ(after.size(), 2U);
    dropped = source->counters().dropped - dropped_before;
    age = after[0].arrived_ns - after[0].frame.timestamp_ns;
    // Their times tell how many there were meanwhile.
    const int64_t passed_ns = after[1].frame.timestamp_ns - before[2].frame.timestamp_ns;
    EXPECT_EQ(dropped, (passed_ns + 10 * kMs) / (20 * kMs) - 2);
  }
  EXPECT_GE(dropped, 12);
  EXPECT_LT(age, 150 * kMs);
}

struct Transport {
  const char* name;
  std::string send, receive;
};

class Rtp : public testing::TestWithParam<Transport> {
 protected:
  std::string receiver() const { return "udpsrc port=" + std::to_string(port_) + " " + GetParam().receive; }
  // Sends 50 pictures a second while the source is watched.
  std::vector<LiveFrame> stream(LiveSource& source, int square_px, milliseconds duration, size_t at_most) {
    RtpSender sender(GetParam().send, port_, square_px);
    std::jthread sending([&](std::stop_token stop) {
      while (!stop.stop_requested()) {
        sender.send();
        std::this_thread::sleep_for(milliseconds(20));
      }
    });
    return watch(source, duration, at_most);
  }
  int port_ = free_udp_port();
};

TEST_P(Rtp, StampsAreWithinTwoMillisecondsOfTheTruth) {
  const auto source = open(receiver());
  const auto pictures = stream(*source, 16, seconds(15), 100);
  ASSERT_EQ(pictures.size(), 100U) << source->counters().last_problem;
  std::vector<int64_t> errors, lateness;
  for (const LiveFrame& picture : pictures) {
    ASSERT_EQ(picture.frame.grey.size(), cv::Size(128, 128));
    const auto truth = static_cast<int64_t>(number_in(picture.frame.grey));
    errors.push_back(std::abs(picture.frame.timestamp_ns - truth));
    lateness.push_back(picture.arrived_ns - truth);
    EXPECT_GE(lateness.back(), 0);
  }
  std::sort(errors.begin(), errors.end());
  std::sort(lateness.begin(), lateness.end());
  RecordProperty("stamp_error_median_us", static_cast<int>(errors[50] / 1000));
  RecordProperty("stamp_error_90_us", static_cast<int>(errors[90] / 1000));
  RecordProperty("stamp_error_worst_us", static_cast<int>(errors[99] / 1000));
  RecordProperty("arrival_median_us", static_cast<int>(lateness[50] / 1000));
  EXPECT_LE(errors[50], 2 * kMs);
}

TEST_P(Rtp, ASenderThatChangesItsSizeStopsAndComesBack) {
  LiveOptions options;
  options.stall = 0.4;
  options.first_picture = 1;
  const auto source = open(receiver(), options);
  ASSERT_EQ(stream(*source, 16, seconds(15), 10).size(), 10U) << source->counters().last_problem;
  const int64_t stalled = source->counters().stalled;
  for (int i = 0; i < 500 && source->counters().stalled == stalled; ++i) source->next(milliseconds(20));
  EXPECT_GT(source->counters().stalled, stalled);
  EXPECT_THAT(source->counters().last_problem, HasSubstr(": no picture for 400 ms"));
  const auto other = stream(*source, GetParam().name == std::string("jpeg") ? 24 : 16, seconds(15), 10);
  EXPECT_EQ(other.size(), 10U) << source->counters().last_problem;
  EXPECT_GE(source->counters().reopened, 1);
  if (GetParam().name == std::string("jpeg")) {
    EXPECT_EQ(other.back().frame.grey.size(), cv::Size(192, 192));
    EXPECT_EQ(source->counters().resized, 1);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Transports, Rtp,
    testing::Values(
        Transport{"jpeg", "video/x-raw,format=I420 ! jpegenc ! rtpjpegpay",
                  "caps=\"application/x-rtp,media=video,clock-rate=90000,encoding-name=JPEG,payload=26\" ! "
                  "rtpjitterbuffer latency=100 ! rtpjpegdepay ! jpegdec"},
        Transport{"raw", "video/x-raw,format=I420 ! rtpvrawpay",
                  "caps=\"application/x-rtp,media=video,clock-rate=90000,encoding-name=RAW,payload=96,"
                  "sampling=YCbCr-4:2:0,depth=(string)8,width=(string)128,height=(string)128\" ! "
                  "rtpjitterbuffer latency=100 ! rtpvrawdepay"}),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace perch
