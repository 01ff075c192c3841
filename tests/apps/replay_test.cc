// A run as perch-live makes it, recorded while it goes on, and perch-batch on the recording.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "perch/camera/image_source.h"
#include "perch/flight/flight.h"
#include "perch/flight/flight_recorder.h"
#include "support/estimates_table.h"
#include "support/rng.h"
#include "support/run_program.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;

constexpr char kSimulation[] =
    "camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5],"
    " rate_hz: 20}\n"
    "flight: {start_height: 6, start_aside: 1, touchdown_height: 1.5, duration: 2.9, hover: 0}\n";
constexpr int kUnreadable = 20;  // this frame

class Replay : public testing::Test {
 protected:
  Replay() {
    folder_.write("landing.yaml",
                  "target: " + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml\n" + kSimulation);
    const Outcome made = run_program_in(folder_, PERCH_SIMULATE, "--config landing.yaml --output sim");
    EXPECT_EQ(made.code, 0) << made.err;
    record();
  }

  // What the autopilot says by the time of a frame: parts of it, late and out of order now and then.
  std::vector<AutopilotSample> said(const NavTrack& nav, size_t& next, int64_t until_ns) {
    std::vector<AutopilotSample> samples;
    for (; next < nav.samples.size() && nav.samples[next].timestamp_ns <= until_ns; ++next) {
      const NavSample& n = nav.samples[next];
      AutopilotSample s;
      s.timestamp_ns = n.timestamp_ns - rng_.index(30'000'000);
      if (rng_.index(4) > 0) s.world_from_body = n.world_from_body.rotation;
      if (rng_.index(4) > 0) s.body_velocity_in_world = n.body_velocity_in_world;
      if (rng_.index(4) > 0) s.angular_velocity_in_body = rng_.normal3(0.02);
      s.attitude_sigma = rng_.uniform(0.005, 0.01);
      samples.push_back(s);
    }
    std::reverse(samples.begin(), samples.end());
    return samples;
  }

  void record() {
    Section root = Section::load(folder_ / "sim/perch.yaml");
    const RunConfig config = read_run_config(root);
    const Flight flight = read_flight(folder_ / "sim");
    FlightRecorder recorder({.folder = folder_ / "recorded", .queue_frames = 1000}, *flight.camera,
                            root.resolved(), flight.body_from_camera, 20);
    Estimator estimator(config, *flight.camera);
    const auto source = open_image_source("flight:" + (folder_ / "sim").string());
    size_t next = 0;
    Frame frame;
    for (int i = 0; source->next(frame); ++i) {
      if (i == kUnreadable) frame.grey.release(), frame.problem = "camera: torn";
      Estimator::Aid aid;
      aid.autopilot = said(flight.nav, next, frame.timestamp_ns);
      if (i % 5 != 0) aid.world_from_body = flight.nav.at(frame.timestamp_ns)->world_from_body.rotation;
      EXPECT_TRUE(recorder.add_frame(frame, aid, estimator.process(frame, aid)));
    }
    recorder.close();
    flight_ = recorder.folder();
  }

  // perch-batch's output of the recording.
  fs::path replay(const std::string& flags = "") const {
    const Outcome result = run_program_in(folder_, PERCH_BATCH,
                                          "--config " + (flight_ / "run/config.yaml").string() +
                                              " --output out " + flags + " " + flight_.string());
    EXPECT_EQ(result.code, 0) << result.err;
    return folder_ / "out" / flight_.filename();
  }
  static std::vector<std::string> problems(const fs::path& output) {
    return nlohmann::json::parse(read_file(output / "summary.json"))["problems"];
  }

  TempFolder folder_;
  TestRng rng_;
  fs::path flight_;
};

TEST_F(Replay, GivesTheLiveRunAgainBitForBit) {
  const fs::path output = replay();
  const auto live = without_times(lines_of(flight_ / "run/estimates.csv"));
  EXPECT_EQ(without_times(lines_of(output / "estimates.csv")), live);
  EXPECT_EQ(live.size(), 60u);
  EXPECT_EQ(std::count_if(live.begin(), live.end(),
                          [](const std::string& line) { return line.find(",ok,") != std::string::npos; }),
            58);
  EXPECT_EQ(read_file(output / "states.csv"), read_file(flight_ / "run/states.csv"));
  // The frame that nobody could read, and no other.
  EXPECT_EQ(problems(output).size(), 1u);
}

TEST_F(Replay, WithoutTheAidsGivesAnotherRun) {
  // The check above is worth something: what the estimator was given matters.
  const fs::path output = replay("--set replay.aids=navigation");
  EXPECT_NE(read_file(output / "states.csv"), read_file(flight_ / "run/states.csv"));
}

TEST_F(Replay, SaysHowManyPicturesWereDropped) {
  // As if the disk had been too slow for three frames.
  constexpr size_t kFirst = 31, kDropped = 3;
  const fs::path data = flight_ / "mav0/cam0/data.csv";
  auto rows = lines_of(data);
  rows.erase(rows.begin() + kFirst, rows.begin() + kFirst + kDropped);
  std::ofstream stream(data);
  for (const std::string& row : rows) stream << row << '\n';
  stream.close();

  const fs::path output = replay();
  EXPECT_THAT(problems(output),
              Contains(HasSubstr("run/aids.csv: 3 frames of the live run have no picture")));
  const auto live = without_times(lines_of(flight_ / "run/estimates.csv"));
  const auto again = without_times(lines_of(output / "estimates.csv"));
  ASSERT_EQ(again.size(), live.size() - kDropped);
  EXPECT_TRUE(std::equal(live.begin(), live.begin() + kFirst, again.begin()));
  // What the autopilot said meanwhile was heard: as many states as there are frames.
  EXPECT_EQ(lines_of(output / "states.csv").size(), lines_of(flight_ / "run/states.csv").size() - kDropped);
}

TEST_F(Replay, SaysHowManyFramesTheAidsDoNotKnow) {
  // As if the run had been killed before the rows of its last frames were written.
  const fs::path aids = flight_ / "run/aids.csv";
  const std::string whole = read_file(aids);
  std::ofstream(aids, std::ios::binary) << whole.substr(0, whole.size() - 10);
  const auto found = problems(replay());
  EXPECT_THAT(found, Contains(HasSubstr("cut off within this row")));
  EXPECT_THAT(found, Contains(HasSubstr("run/aids.csv: does not know 1 of the frames")));
}

}  // namespace
}  // namespace perch
