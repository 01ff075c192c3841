#include "perch/frames/axis_test.h"

#include <gtest/gtest.h>

#include "support/rng.h"

namespace perch {
namespace {

using Eigen::Vector3d;

constexpr int64_t kFrame = 33'333'333;

// A hand that holds the pad, or moves it, and a camera of 30 Hz with 2 mm of noise.
class Bench {
 public:
  explicit Bench(BodyAxis axis) : test(axis) {}

  std::optional<AxisTest::Verdict> hold(double seconds) { return move(Vector3d::Zero(), seconds); }
  std::optional<AxisTest::Verdict> move(const Vector3d& by, double seconds) {
    std::optional<AxisTest::Verdict> verdict;
    const Vector3d from = place;
    const auto frames = static_cast<int>(seconds * 30);
    for (int i = 1; i <= frames && !verdict; ++i) {
      place = from + by * i / frames;
      verdict = test.see(now += kFrame, place + rng.normal3(0.002));
    }
    return verdict;
  }

  AxisTest test;
  TestRng rng;
  Vector3d place{0.1, -0.2, 1.5};
  int64_t now = 0;
};

TEST(AxisTest, TheRightWayIsGood) {
  const Vector3d ways[] = {{0.2, 0.02, 0}, {0, 0.3, -0.05}, {0.01, 0.02, 0.25}};
  for (const BodyAxis axis : {BodyAxis::kForward, BodyAxis::kRight, BodyAxis::kDown}) {
    Bench bench(axis);
    EXPECT_FALSE(bench.hold(1.5));
    EXPECT_TRUE(bench.test.may_move());
    EXPECT_FALSE(bench.move(ways[static_cast<size_t>(axis)], 1));
    const auto verdict = bench.hold(2);
    ASSERT_TRUE(verdict);
    EXPECT_TRUE(verdict->good) << verdict->seen;
  }
}

TEST(AxisTest, EveryOtherWayIsWrongAndSaidInWords) {
  struct Case {
    Vector3d way;
    const char* words;
  };
  for (const auto& [way, words] :
       {Case{{-0.2, 0, 0}, "20 cm backward"}, Case{{0, 0.2, 0}, "20 cm to the right"},
        Case{{0, -0.2, 0}, "20 cm to the left"}, Case{{0, 0, -0.2}, "20 cm up"},
        Case{{0.2, 0, 0.15}, "20 cm forward, 15 cm down"}}) {
    Bench bench(BodyAxis::kForward);
    EXPECT_FALSE(bench.hold(1.5));
    EXPECT_FALSE(bench.move(way, 1));
    const auto verdict = bench.hold(2);
    ASSERT_TRUE(verdict) << words;
    EXPECT_FALSE(verdict->good) << words;
    EXPECT_EQ(verdict->seen, words);
  }
}

TEST(AxisTest, NothingIsSaidOfAPadThatIsNotHeldStill) {
  Bench bench(BodyAxis::kForward);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(bench.move(Vector3d(0.3, 0, 0) * (i % 2 ? 1 : -1), 0.5));
  EXPECT_FALSE(bench.test.may_move());
}

TEST(AxisTest, AStretchWithoutPicturesIsNoRest) {
  Bench bench(BodyAxis::kForward);
  EXPECT_FALSE(bench.hold(0.6));
  bench.now += 5'000'000'000;
  EXPECT_FALSE(bench.hold(0.6));
  EXPECT_FALSE(bench.test.may_move());
  EXPECT_FALSE(bench.hold(0.6));
  EXPECT_TRUE(bench.test.may_move());
}

TEST(AxisTest, ASmallMoveWaitsForMore) {
  Bench bench(BodyAxis::kForward);
  EXPECT_FALSE(bench.hold(1.5));
  EXPECT_FALSE(bench.move({0.08, 0, 0}, 0.5));
  EXPECT_FALSE(bench.hold(2));
  EXPECT_FALSE(bench.move({0.1, 0, 0}, 0.5));
  const auto verdict = bench.hold(2);
  ASSERT_TRUE(verdict);
  EXPECT_TRUE(verdict->good);
}

}  // namespace
}  // namespace perch
