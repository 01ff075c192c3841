#include "perch/camera/v4l2_device.h"

#include <gmock/gmock.h>

#include "camera/fake_v4l2.h"
#include "support/config_error.h"
#include "support/rng.h"

namespace perch {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr int64_t kMs = 1'000'000;

class V4l2Device : public testing::Test {
 protected:
  std::unique_ptr<LiveSource> open(const LiveOptions& options = {}, Channel channel = Channel::kGrey) {
    return make_live_camera(make_v4l2_device("/dev/video0", options, channel, kernel_, clock_), options,
                            clock_);
  }
  // Asks for pictures for so long; how many came.
  int watch(LiveSource& source, int64_t duration_ms) {
    int pictures = 0;
    for (const int64_t end = clock_.now_ns() + duration_ms * kMs; clock_.now_ns() < end;) {
      if (source.next(milliseconds(10))) ++pictures;
    }
    return pictures;
  }
  // What is wrong when it is opened.
  std::string complaint(const LiveOptions& options = {}) {
    const auto source = open(options);
    EXPECT_FALSE(source->next(milliseconds(50)));
    return source->counters().last_problem;
  }
  FakeClock clock_;
  FakeV4l2 kernel_{clock_};
};

TEST_F(V4l2Device, GivesPicturesStampedInTheMiddleOfTheExposure) {
  const auto source = open();
  LiveFrame picture = source->next(milliseconds(50)).value();
  EXPECT_EQ(picture.frame.grey.size(), cv::Size(64, 48));
  EXPECT_EQ(picture.frame.grey.at<uint8_t>(47, 63), 100);
  // The exposure of 10 ms begins 12 ms before; the driver's stamps have whole microseconds.
  EXPECT_NEAR(static_cast<double>(picture.arrived_ns - picture.frame.timestamp_ns), 7e6, 1000);
  kernel_.stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
  picture = source->next(milliseconds(50)).value();
  EXPECT_NEAR(static_cast<double>(picture.arrived_ns - picture.frame.timestamp_ns), 7e6, 1000);
  EXPECT_EQ(watch(*source, 1000), 30);
  EXPECT_EQ(source->counters().last_problem, "");
}

TEST_F(V4l2Device, FollowsAnAutomaticExposure) {
  const auto source = open();
  watch(*source, 500);
  kernel_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = 40;
  watch(*source, 1100);
  const LiveFrame picture = source->next(milliseconds(50)).value();
  EXPECT_NEAR(static_cast<double>(picture.arrived_ns - picture.frame.timestamp_ns), 10e6, 1000);
}

TEST_F(V4l2Device, TimesThatAreNotKnownAreSaid) {
  kernel_.stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_COPY;
  auto source = open();
  const LiveFrame picture = source->next(milliseconds(50)).value();
  EXPECT_EQ(picture.arrived_ns - picture.frame.timestamp_ns, 5 * kMs);  // half the exposure
  EXPECT_THAT(source->counters().last_problem, HasSubstr("v4l2:/dev/video0: pictures without a time"));
  source.reset();
  kernel_.stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  kernel_.controls.erase(V4L2_CID_EXPOSURE_ABSOLUTE);
  source = open();
  watch(*source, 100);
  EXPECT_THAT(source->counters().last_problem, HasSubstr("the exposure is not known: its end is taken"));
}

TEST_F(V4l2Device, SetsExposureAndGain) {
  LiveOptions options;
  options.exposure = 0.004;
  options.gain = 20;
  const auto source = open(options);
  watch(*source, 100);
  EXPECT_EQ(kernel_.controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(kernel_.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 40);
  EXPECT_EQ(kernel_.controls[V4L2_CID_AUTOGAIN], 0);
  EXPECT_EQ(kernel_.controls[V4L2_CID_GAIN], 20);
}

TEST_F(V4l2Device, ControlsThatCannotBeSetAreSaid) {
  LiveOptions options;
  options.exposure = 0.5;
  EXPECT_EQ(complaint(options), "v4l2:/dev/video0: camera.exposure: 0.5: the camera takes 0.0001 to 0.2");
  kernel_.controls.erase(V4L2_CID_EXPOSURE_ABSOLUTE);
  EXPECT_THAT(complaint(options), HasSubstr("camera.exposure: the camera has no exposure"));
  options.exposure.reset();
  options.gain = 65;
  EXPECT_THAT(complaint(options), HasSubstr("camera.gain: 65: the camera takes 1 to 64"));
}

TEST_F(V4l2Device, ChoosesTheFormatThatHasSizeAndRate) {
  kernel_.modes = {
      {"YUYV", 1280, 720, 10}, {"YUYV", 640, 480, 30}, {"MJPG", 1280, 720, 30}, {"MJPG", 640, 480, 30}};
  LiveOptions options;
  options.width = 640, options.height = 480, options.rate_hz = 30;
  watch(*open(options), 50);
  EXPECT_EQ(kernel_.mode.format, "YUYV");
  options.width = 1280, options.height = 720;
  watch(*open(options), 50);
  EXPECT_EQ(kernel_.mode.format, "MJPG");
  options.format = "YUYV";
  const auto slow = open(options);
  EXPECT_GT(watch(*slow, 300), 1);
  EXPECT_EQ(kernel_.mode.format, "YUYV");
  EXPECT_EQ(slow->counters().last_problem, "v4l2:/dev/video0: gives 10 Hz, 30 were asked for");
}

TEST_F(V4l2Device, WhatTheCameraHasNotIsSaid) {
  kernel_.modes = {{"YUYV", 64, 48, 30}, {"H264", 64, 48, 30}};
  LiveOptions options;
  options.width = 640, options.height = 480;
  EXPECT_EQ(complaint(options),
            "v4l2:/dev/video0: has no pictures of 640x480, the nearest are 64x48 as YUYV");
  options = {};
  options.format = "NV12";
  EXPECT_EQ(complaint(options), "v4l2:/dev/video0: has no pixel format that is wanted, but YUYV, H264");
  kernel_.capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  EXPECT_THAT(complaint(), HasSubstr("gives no pictures"));
  kernel_.there = false;
  EXPECT_EQ(complaint(), "v4l2:/dev/video0: No such file or directory");
  kernel_.there = true;
  kernel_.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  kernel_.fails[VIDIOC_REQBUFS] = EBUSY;
  EXPECT_FALSE(kernel_.fails.empty());
  const auto source = open();
  EXPECT_FALSE(source->next(milliseconds(50)));
  EXPECT_THAT(source->counters().last_problem, HasSubstr("Device or resource busy"));
}

TEST_F(V4l2Device, MistakesInTheConfigurationAreSaidAtOnce) {
  LiveOptions options;
  EXPECT_THAT(config_error([&] { open_live_source("v4l2:video0", options); }),
              HasSubstr("expected v4l2: and a device such as /dev/video0, found \"v4l2:video0\""));
  options.format = "H264";
  EXPECT_THAT(config_error([&] { open(options); }), HasSubstr("camera.format: expected one of GREY, NV12"));
  options.format = "GREY";  // has no red
  EXPECT_THAT(config_error([&] { open(options, Channel::kRed); }),
              HasSubstr("camera.format: expected one of NV12"));
}

TEST(TheKernel, SaysWhatIsNoCamera) {
  for (const auto& [device, why] : {std::pair{"/dev/null", "no camera: Inappropriate ioctl for device"},
                                    {"/dev/perch_nowhere", "No such file or directory"}}) {
    const auto source = open_live_source(std::string("v4l2:") + device);
    EXPECT_FALSE(source->next(milliseconds(10)));
    EXPECT_EQ(source->counters().last_problem, std::string("v4l2:") + device + ": " + why);
  }
}

TEST_F(V4l2Device, LostPicturesAreCounted) {
  const auto source = open();
  watch(*source, 100);
  EXPECT_EQ(source->counters().dropped, 0);
  kernel_.skip = 3;
  watch(*source, 100);
  EXPECT_EQ(source->counters().dropped, 3);
  kernel_.broken = 2;
  EXPECT_EQ(watch(*source, 200), 4);
  EXPECT_EQ(source->counters().dropped, 5);
  EXPECT_THAT(source->counters().last_problem, HasSubstr("marks as broken"));
  clock_.pass(1000 * kMs);  // nobody asked: four were kept, the others had no place
  const LiveFrame picture = source->next(milliseconds(0)).value();
  EXPECT_EQ(source->counters().dropped, 8);
  EXPECT_GT(picture.arrived_ns - picture.frame.timestamp_ns, 800 * kMs);
  watch(*source, 200);
  EXPECT_NEAR(static_cast<double>(source->counters().dropped), 5 + 29, 1);
  EXPECT_EQ(kernel_.queued(), 4);
}

TEST_F(V4l2Device, ACutPictureIsUnreadable) {
  const auto source = open();
  kernel_.short_bytes = 1;
  const LiveFrame picture = source->next(milliseconds(50)).value();
  EXPECT_EQ(picture.frame.problem, "v4l2:/dev/video0: cut off: 3072 bytes of 6144");
  EXPECT_TRUE(picture.frame.grey.empty());
  EXPECT_TRUE(source->next(milliseconds(50)).value().frame.problem.empty());
}

TEST_F(V4l2Device, UnpluggedAndBackWithAnotherSize) {
  const auto source = open();
  watch(*source, 500);
  kernel_.there = false;
  EXPECT_LE(watch(*source, 2000), 1);
  EXPECT_GE(source->counters().open_failed, 3);
  kernel_.modes = {{"NV12", 32, 24, 30, 16}};
  kernel_.there = true;
  EXPECT_GT(watch(*source, 4000), 30);
  EXPECT_EQ(source->counters().reopened, 1);
  EXPECT_EQ(source->counters().resized, 1);
  EXPECT_EQ(source->next(milliseconds(50)).value().frame.grey.size(), cv::Size(32, 24));
}

TEST_F(V4l2Device, ASizeThatChangesWhileItStreams) {
  const auto source = open();
  watch(*source, 500);
  kernel_.modes = {{"GREY", 80, 60, 30}};
  kernel_.size_event = true;
  EXPECT_GT(watch(*source, 1000), 20);
  EXPECT_EQ(source->counters().reopened, 1);
  EXPECT_EQ(source->counters().resized, 1);
  EXPECT_THAT(source->counters().last_problem, HasSubstr("has changed its size"));
}

TEST_F(V4l2Device, AFrozenCameraIsOpenedAnew) {
  const auto source = open();
  watch(*source, 500);
  kernel_.frozen = true;
  EXPECT_EQ(watch(*source, 1500), 0);
  EXPECT_GE(source->counters().stalled, 1);
  kernel_.frozen = false;
  EXPECT_GT(watch(*source, 1000), 20);
}

// Whichever call fails, in whatever way: nothing is thrown, nothing stays open or mapped (the fake kernel
// sees to that), and pictures come again.
TEST_F(V4l2Device, AnyCallMayFail) {
  LiveOptions options;
  options.rate_hz = 30;
  options.exposure = 0.004;
  options.gain = 4;
  for (const int error : {EIO, ENODEV, EBUSY, EINVAL, EAGAIN, ENOMEM}) {
    bool reached = true;
    for (int call = 0; reached; ++call) {
      kernel_.calls = 0;
      kernel_.fail_call = call;
      kernel_.fail_errno = error;
      const auto source = open(options);
      watch(*source, 200);
      reached = kernel_.calls > call && call < 60;
      kernel_.fail_call = -1;
      watch(*source, 1000);
      EXPECT_GE(watch(*source, 400), 11) << "call " << call << " failed with " << std::strerror(error) << ": "
                                         << source->counters().last_problem;
    }
  }
}

TEST_F(V4l2Device, SurvivesAnythingInAnyOrder) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    TestRng rng(seed);
    const auto source = open();
    int64_t last = 0;
    const auto look = [&](int64_t duration_ms) {
      int pictures = 0;
      for (const int64_t end = clock_.now_ns() + duration_ms * kMs; clock_.now_ns() < end;) {
        if (const auto picture = source->next(milliseconds(1 + rng.index(60)))) {
          EXPECT_GT(picture->frame.timestamp_ns, last);
          EXPECT_EQ(picture->frame.grey.empty(), !picture->frame.problem.empty());
          last = picture->frame.timestamp_ns;
          ++pictures;
        }
      }
      return pictures;
    };
    const unsigned long requests[] = {
        VIDIOC_DQBUF, VIDIOC_QBUF, VIDIOC_STREAMON, VIDIOC_S_FMT, VIDIOC_REQBUFS, 1, 2};
    const std::vector<FakeV4l2::Mode> modes = {{"YUYV", 64, 48, 30},
                                               {"GREY", 80, 60, 50},
                                               {"NV12", 32, 24, 30, 16},
                                               {"MJPG", 64, 48, 30},
                                               {"H264", 64, 48, 30}};
    for (int event = 0; event < 20; ++event) {
      kernel_.there = rng.index(4) > 0;
      kernel_.frozen = rng.index(4) == 0;
      kernel_.skip = static_cast<uint32_t>(rng.index(3));
      kernel_.broken = rng.index(4);
      kernel_.short_bytes = rng.index(2);
      kernel_.size_event = rng.index(4) == 0;
      kernel_.modes = {modes[static_cast<size_t>(rng.index(5))]};
      if (rng.index(3) == 0) kernel_.fails[requests[rng.index(7)]] = rng.index(2) ? EIO : EAGAIN;
      if (rng.index(3) == 0) clock_.pass(rng.index(2000) * kMs);
      look(rng.index(1500));
    }
    kernel_.there = true;
    kernel_.frozen = false;
    kernel_.broken = kernel_.short_bytes = 0;
    kernel_.modes = {modes[0]};
    kernel_.size_event = true;
    kernel_.fails.clear();
    look(5500);
    EXPECT_GE(look(500), 12) << seed << ": " << source->counters().last_problem;
  }
}

}  // namespace
}  // namespace perch
