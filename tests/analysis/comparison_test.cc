#include "perch/analysis/comparison.h"

#include <gmock/gmock.h>

#include <cmath>

#include "support/rng.h"

namespace perch {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// A season in which B's errors are A's times `factor`, each flight's with a scatter of its own, and B finds
// `more` of 100 frames more.
std::vector<ComparedFrames> season(size_t flights, double factor, double scatter, size_t more, TestRng& rng) {
  std::vector<ComparedFrames> samples;
  for (size_t i = 0; i < flights; ++i) {
    ComparedFrames s;
    s.frames = 100;
    s.ok = {90, 90 + more};
    s.us = {1e4, 1e4};
    s.both = 90;
    const double size = rng.uniform(0.5, 2), ratio = factor * (1 + scatter * rng.normal());
    s.position = s.over_range = s.angles = {size * size, size * size * ratio * ratio};
    samples.push_back(s);
  }
  return samples;
}

const Change& named(const std::vector<Change>& changes, const std::string& name) {
  for (const Change& change : changes) {
    if (change.sentence.starts_with(name)) return change;
  }
  ADD_FAILURE() << name;
  return changes.front();
}

TEST(Comparison, ARunAgainstItselfIsUnchanged) {
  TestRng rng;
  const auto changes = changes_of(season(50, 1, 0, 0, rng));
  ASSERT_EQ(changes.size(), 5u);
  for (const Change& change : changes) {
    EXPECT_EQ(change.verdict, Verdict::kUnchanged) << change.sentence;
    EXPECT_EQ(change.percent.low, 0);
    EXPECT_EQ(change.percent.high, 0);
  }
  EXPECT_EQ(changes[0].sentence, "B finds as many frames within 0.1 % [+0.00, +0.00]");
}

TEST(Comparison, SaysWhatIsBetterAndWhatIsWorse) {
  TestRng rng;
  const auto changes = changes_of(season(50, 1.2, 0.05, 2, rng));
  EXPECT_EQ(changes[0].verdict, Verdict::kBetter);
  EXPECT_EQ(changes[0].sentence, "B finds 2.00 % more frames [2.00, 2.00]");
  const Change& position = named(changes, "position RMS");
  EXPECT_EQ(position.verdict, Verdict::kWorse);
  EXPECT_NEAR(position.percent.value, 20, 3);
  EXPECT_THAT(position.sentence, HasSubstr(" higher ["));
  const auto back = changes_of(season(50, 1 / 1.2, 0.05, 0, rng));
  EXPECT_EQ(named(back, "position RMS").verdict, Verdict::kBetter);
  EXPECT_THAT(named(back, "position RMS").sentence, HasSubstr(" lower ["));
}

TEST(Comparison, ChanceIsCalledChance) {
  TestRng rng;
  const auto changes = changes_of(season(10, 1.03, 0.3, 0, rng));
  EXPECT_EQ(named(changes, "attitude RMS").verdict, Verdict::kUnclear);
  EXPECT_THAT(named(changes, "attitude RMS").sentence, HasSubstr(", which may be chance"));
  // One sample has no spread, and so no verdict.
  for (const Change& change : changes_of(season(1, 2, 0, 5, rng)))
    EXPECT_EQ(change.verdict, Verdict::kUnclear);
}

// The property that makes it an interval: 95 of 100 hold the truth. The percentile bootstrap of 40 samples is
// known to be a little short; 300 trials scatter by 1.5 of 100.
TEST(Comparison, IntervalsHoldTheTruth) {
  TestRng rng;
  int held = 0;
  constexpr int kTrials = 300;
  for (int i = 0; i < kTrials; ++i) {
    auto samples = season(40, 1, 0, 0, rng);
    for (ComparedFrames& s : samples) {
      for (int frame = 0; frame < 10; ++frame) s.ok[1] -= rng.uniform(0, 1) < 0.3;
    }
    const Interval found = changes_of(samples)[0].percent;
    held += found.low <= -3 && -3 <= found.high;
  }
  EXPECT_GE(held, kTrials * 90 / 100);
  EXPECT_LE(held, kTrials * 99 / 100);
}

TEST(Comparison, TheSameSamplesGiveTheSameNumbers) {
  TestRng rng;
  const auto samples = season(30, 1.1, 0.1, 1, rng);
  const auto once = changes_of(samples), again = changes_of(samples);
  for (size_t i = 0; i < once.size(); ++i) EXPECT_EQ(once[i].sentence, again[i].sentence);
}

TEST(Comparison, NothingToCompareIsNoNumber) {
  EXPECT_TRUE(changes_of({}).empty());
  const std::vector<ComparedFrames> empty(3);
  EXPECT_TRUE(changes_of(empty).empty());
  std::vector<ComparedFrames> blind(3);
  for (ComparedFrames& s : blind) s.frames = 10;
  const auto changes = changes_of(blind);
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_THAT(changes[0].sentence, StartsWith("B finds as many frames"));
}

}  // namespace
}  // namespace perch
