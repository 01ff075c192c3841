#include "live_recording.h"

#include "flight/recording.h"

namespace perch {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::StartsWith;

class LiveRecordingTest : public Recording {
 protected:
  LiveRecording::Make make() {
    return [this] { return recorder(); };
  }
  // One picture into what is recording now.
  void see(const LiveRecording& recording, int i) {
    ASSERT_TRUE(add(*recording.recorder(), i));
    wait_until([&] { return recording.status()["frames"] == 1; });
  }
};

TEST_F(LiveRecordingTest, RecordsFromTheStartAndSaysHowItGoes) {
  LiveRecording recording(make());
  ASSERT_TRUE(recording.recorder());
  see(recording, 0);
  const json status = recording.status();
  EXPECT_EQ(status["on"], true);
  EXPECT_EQ(status["possible"], true);
  EXPECT_EQ(status["folder"], recording.recorder()->folder().filename().string());
  EXPECT_EQ(status["frames"], 1);
  EXPECT_EQ(status["dropped"], 0);
  EXPECT_EQ(status["disk_left"], 1e12);
  EXPECT_EQ(status["problem"], "");
}

TEST_F(LiveRecordingTest, EachStartIsAFlightOfItsOwn) {
  LiveRecording recording(make());
  const std::string first = recording.status()["folder"];
  see(recording, 0);
  EXPECT_EQ(recording.start(), "record: it is recording");
  EXPECT_EQ(recording.stop(), "recorded " + first + ": 1 pictures");
  EXPECT_EQ(recording.recorder(), nullptr);
  EXPECT_EQ(recording.status()["on"], false);
  EXPECT_EQ(recording.stop(), "stop: nothing is recording");

  EXPECT_THAT(recording.start(), StartsWith("recording "));
  const std::string second = recording.status()["folder"];
  EXPECT_NE(second, first);
  see(recording, 1);
  recording.stop();
  EXPECT_EQ(Recorded(options.folder / first).frames.size(), 1u);
  EXPECT_EQ(Recorded(options.folder / second).frames[0].timestamp_ns, kStartNs + kPeriodNs);
}

TEST_F(LiveRecordingTest, WithoutAFolderThereIsNothingToStart) {
  LiveRecording recording({});
  EXPECT_EQ(recording.recorder(), nullptr);
  EXPECT_EQ(recording.status(), (json{{"on", false}, {"possible", false}, {"problem", ""}}));
  EXPECT_EQ(recording.start(), "record: outputs.record names no folder");
}

TEST_F(LiveRecordingTest, ADiskThatTakesNothingIsAProblemUntilItDoes) {
  disk_->full = true;
  LiveRecording recording(make());  // does not throw: a vehicle lands without a recording, too
  EXPECT_EQ(recording.recorder(), nullptr);
  EXPECT_THAT(recording.problem(), HasSubstr("No space left on device"));
  EXPECT_THAT(recording.status()["problem"], HasSubstr("No space left on device"));
  EXPECT_THAT(recording.start(), StartsWith("record: there is no recording: "));
  disk_->full = false;
  EXPECT_THAT(recording.start(), StartsWith("recording "));
  EXPECT_EQ(recording.problem(), "");
}

// Who took the pointer before it was stopped may write to it after.
TEST_F(LiveRecordingTest, StoppedUnderWhoRecordsItOnlyRefuses) {
  LiveRecording recording(make());
  const auto held = recording.recorder();
  see(recording, 0);
  recording.stop();
  EXPECT_FALSE(add(*held, 1));
  EXPECT_EQ(held->counters().frames_written, 1);
}

}  // namespace
}  // namespace perch
