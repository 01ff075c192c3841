// What is left of a recording whose process was killed, or whose files were cut off.

#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "flight/recording.h"

namespace perch {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

// What a child has told its parent so far.
struct Progress {
  std::atomic<int> frames, pictures;
};

TEST_F(Recording, KilledAtAnyMomentItLosesASecondAtMost) {
  constexpr int kRounds = 5, kAtATime = 4;
  int lost_more = 0;
  auto* progress = static_cast<Progress*>(
      mmap(nullptr, kAtATime * sizeof(Progress), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  ASSERT_NE(progress, MAP_FAILED);
  for (int round = 0; round < kRounds; ++round) {
    options.format = round % 2 == 0 ? "png" : "ffv1";
    std::vector<pid_t> children;
    std::vector<fs::path> folders;
    for (int c = 0; c < kAtATime; ++c) {
      options.folder = folder_ / ("round" + std::to_string(round) + "_" + std::to_string(c));
      folders.push_back(options.folder);
      progress[c].frames = progress[c].pictures = 0;
      const pid_t child = fork();
      if (child == 0) {
        const auto r = recorder();
        const Frame one = frame(0);
        for (int i = 0;; ++i) {
          Frame f = one;
          f.timestamp_ns += i * kPeriodNs;
          if (r->add_frame(f, aid(i), estimate(i))) ++progress[c].pictures;
          ++progress[c].frames;
          std::this_thread::sleep_for(1ms);
        }
      }
      ASSERT_GT(child, 0);
      children.push_back(child);
    }
    // The first video of a process takes its time to begin.
    for (int c = 0; c < kAtATime; ++c) wait_until([&] { return progress[c].pictures > 0; });
    std::this_thread::sleep_for(std::chrono::microseconds(100'000 + rng.bits() % 300'000));
    const auto so_far = [&] {
      std::vector<std::pair<size_t, size_t>> counts;
      for (int c = 0; c < kAtATime; ++c) counts.emplace_back(progress[c].frames, progress[c].pictures);
      return counts;
    };
    const auto three_seconds_ago = so_far();
    std::this_thread::sleep_for(2s);
    const auto a_second_ago = so_far();
    std::this_thread::sleep_for(1s);
    for (const pid_t child : children) {
      kill(child, SIGKILL);
      std::this_thread::sleep_for(std::chrono::microseconds(rng.bits() % 10'000));
    }
    for (const pid_t child : children) waitpid(child, nullptr, 0);
    for (size_t c = 0; c < kAtATime; ++c) {
      const Recorded recorded(fs::directory_iterator(folders[c])->path());
      const size_t rows = std::min({recorded.aids.size(), recorded.estimates.size(), recorded.states.size()});
      EXPECT_GT(three_seconds_ago[c].second, 0u);
      EXPECT_GE(rows, three_seconds_ago[c].first);
      EXPECT_GE(recorded.frames.size(), three_seconds_ago[c].second);
      lost_more += rows < a_second_ago[c].first || recorded.frames.size() < a_second_ago[c].second;
      // A row that was cut off at most, in each of the files; every picture that has a row is whole.
      EXPECT_LE(recorded.problems.size(), 4u) << testing::PrintToString(recorded.problems);
      for (const std::string& problem : recorded.problems) EXPECT_THAT(problem, HasSubstr("cut off"));
    }
  }
  // A disk that others keep busy takes longer now and then.
  EXPECT_LE(lost_more, kRounds * kAtATime / 4);
  munmap(progress, kAtATime * sizeof(Progress));
}

TEST_F(Recording, CutOffAnywhereItsTablesKeepWhatIsWhole) {
  auto r = recorder();
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(add(*r, i));
    r->add_navigation({kStartNs + i, {}, {1.25, 2.5, 3.125}});
  }
  r->close();
  const fs::path flight = r->folder();
  for (const char* name : {"mav0/cam0/data.csv", "mav0/nav0/data.csv", "mav0/gimbal0/data.csv",
                           "run/estimates.csv", "run/states.csv"}) {
    const std::string whole = read_file(flight / name);
    for (size_t cut = 1; whole[whole.size() - cut - 1] != '\n'; ++cut) {
      std::ofstream(flight / name, std::ios::binary) << whole.substr(0, whole.size() - cut);
      const Recorded recorded(flight);
      ASSERT_EQ(recorded.problems.size(), 1u) << name << " less " << cut;
      EXPECT_THAT(recorded.problems[0],
                  EndsWith(std::string(name) + ":4: the file was cut off within this row, row skipped"));
    }
    std::ofstream(flight / name, std::ios::binary) << whole;
  }
}

}  // namespace
}  // namespace perch
