#include "perch/camera/paced_source.h"

#include <gmock/gmock.h>

#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "camera/fake_clock.h"
#include "perch/config/error.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr int64_t kMs = 1'000'000;

// Pictures at the given times, 4x4 and then, from the number `wide_from` on, 8x4.
class Pictures : public ImageSource {
 public:
  explicit Pictures(std::vector<int64_t> times_ns, size_t wide_from = 1000)
      : times_ns_(std::move(times_ns)), wide_from_(wide_from) {}
  bool advance(Frame& frame) override {
    if (next_ == times_ns_.size()) return false;
    frame = Frame{};
    frame.name = std::to_string(next_);
    frame.timestamp_ns = times_ns_[next_++];
    return true;
  }
  void read(Frame& frame) const override {
    frame.grey = cv::Mat::zeros(4, std::stoul(frame.name) < wide_from_ ? 4 : 8, CV_8UC1);
  }
  int64_t size() const override { return -1; }

 private:
  std::vector<int64_t> times_ns_;
  size_t wide_from_, next_ = 0;
};

// The pictures given out as "number at ms since the start".
std::vector<std::string> play(LiveSource& source, FakeClock& clock, int64_t thinking_ns = 0) {
  const int64_t start = clock.now_ns();
  std::vector<std::string> given;
  while (!source.ended()) {
    const auto picture = source.next(milliseconds(10));
    if (!picture) continue;
    given.push_back(picture->frame.name + " at " + std::to_string((picture->arrived_ns - start) / kMs));
    clock.pass(thinking_ns);
  }
  return given;
}

TEST(PacedSource, GivesEachPictureWhenItIsDue) {
  FakeClock clock;
  const std::vector<int64_t> times = {100 * kMs, 133 * kMs, 200 * kMs};
  const auto source = pace_pictures(std::make_unique<Pictures>(times), Pace::kRealTime, clock);
  EXPECT_TRUE(source->recorded());
  EXPECT_FALSE(source->ended());
  EXPECT_THAT(play(*source, clock), ElementsAre("0 at 0", "1 at 33", "2 at 100"));
  EXPECT_FALSE(source->next(milliseconds(10)));
  EXPECT_EQ(source->counters().frames, 3);
  EXPECT_EQ(source->counters().dropped, 0);
}

TEST(PacedSource, KeepsTheRecordingsStampsAndWaitsNoLongerThanAsked) {
  FakeClock clock;
  const auto source = pace_pictures(std::make_unique<Pictures>(std::vector<int64_t>{7, 7 + 50 * kMs}),
                                    Pace::kRealTime, clock);
  EXPECT_EQ(source->next(milliseconds(1)).value().frame.timestamp_ns, 7);
  const int64_t before = clock.now_ns();
  EXPECT_FALSE(source->next(milliseconds(20)));
  EXPECT_EQ(clock.now_ns() - before, 20 * kMs);
  EXPECT_EQ(source->next(milliseconds(40)).value().frame.timestamp_ns, 7 + 50 * kMs);
  EXPECT_EQ(clock.now_ns() - before, 50 * kMs);
}

TEST(PacedSource, InRealTimeWhoIsSlowGetsTheNewest) {
  FakeClock clock;
  const std::vector<int64_t> times = {0, 10 * kMs, 20 * kMs, 30 * kMs, 40 * kMs, 50 * kMs};
  const auto source = pace_pictures(std::make_unique<Pictures>(times), Pace::kRealTime, clock);
  EXPECT_THAT(play(*source, clock, 25 * kMs), ElementsAre("0 at 0", "2 at 25", "5 at 50"));
  EXPECT_EQ(source->counters().dropped, 3);
}

TEST(PacedSource, AsFastAsPossibleNoneIsLeftOutAndNoTimePasses) {
  FakeClock clock;
  const std::vector<int64_t> times = {0, 10 * kMs, 20 * kMs, 30 * kMs};
  const auto source = pace_pictures(std::make_unique<Pictures>(times), Pace::kFast, clock);
  EXPECT_THAT(play(*source, clock, 25 * kMs), ElementsAre("0 at 0", "1 at 25", "2 at 50", "3 at 75"));
  EXPECT_EQ(source->counters().dropped, 0);
}

TEST(PacedSource, AWrongTimeHoldsNothingUpForLong) {
  FakeClock clock;
  const std::vector<int64_t> times = {std::numeric_limits<int64_t>::min(), 0, 3'600'000 * kMs,
                                      std::numeric_limits<int64_t>::max()};
  const auto source = pace_pictures(std::make_unique<Pictures>(times), Pace::kRealTime, clock);
  EXPECT_THAT(play(*source, clock), ElementsAre("0 at 0", "1 at 5000", "2 at 10000", "3 at 15000"));
}

TEST(PacedSource, ANewSizeIsCounted) {
  FakeClock clock;
  const auto source =
      pace_pictures(std::make_unique<Pictures>(std::vector<int64_t>{1, 2, 3, 4}, 2), Pace::kFast, clock);
  play(*source, clock);
  EXPECT_EQ(source->counters().resized, 1);
}

TEST(OpenLiveSource, PlaysARecordedFlight) {
  const TempFolder folder;
  folder.write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1000,1.png\n2000,absent.png\n");
  folder.write("mav0/cam0/data/x", "");
  cv::imwrite((folder / "mav0/cam0/data/1.png").string(), cv::Mat::zeros(4, 4, CV_8UC1));
  LiveOptions options;
  options.pace = Pace::kFast;
  const auto source = open_live_source("flight:" + folder.path().string(), options);
  EXPECT_EQ(source->next(milliseconds(0)).value().frame.timestamp_ns, 1000);
  EXPECT_FALSE(source->ended());
  EXPECT_THAT(source->next(milliseconds(0)).value().frame.problem, HasSubstr("no such file"));
  EXPECT_TRUE(source->ended());
  EXPECT_THAT(source->counters().last_problem, HasSubstr("absent.png: no such file"));
}

TEST(OpenLiveSource, SaysWhatIsNoSource) {
  for (const char* source : {"", "camera7", "flight:", "film:x"}) {
    EXPECT_THAT([&] { open_live_source(source); },
                ThrowsMessage<ConfigError>(HasSubstr("camera.source: expected v4l2:")));
  }
  EXPECT_THAT([&] { open_live_source("flight:/nowhere"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("/nowhere: no flight")));
}

}  // namespace
}  // namespace perch
