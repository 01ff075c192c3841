#include "perch/detection/level_surface.h"

#include <gtest/gtest.h>

#include <vector>

#include "support/rng.h"

namespace perch {
namespace {

double vignetted(const Eigen::Vector2d& p) {
  const Eigen::Vector2d u = (p - Eigen::Vector2d(320, 240)) / 600;
  return 130 + 12 * u.x() - 60 * u.squaredNorm();
}

std::vector<LevelSample> samples(TestRng& rng, int count, double sigma) {
  std::vector<LevelSample> samples;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d p(rng.uniform(150, 450), rng.uniform(100, 400));
    samples.push_back({p, vignetted(p) + rng.normal(sigma), sigma * sigma});
  }
  return samples;
}

TEST(LevelSurface, FollowsVignetting) {
  TestRng rng;
  LevelSurface surface;
  surface.fit(samples(rng, 100, 0.5));
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d p(rng.uniform(170, 430), rng.uniform(120, 380));
    const auto level = surface.at(p);
    // Four sigma of six numbers from 100 samples, more at the rim.
    EXPECT_NEAR(level.value, vignetted(p), 4 * 0.5 * std::sqrt(12.0 / 100));
    const Eigen::Vector2d slope(
        (vignetted(p + Eigen::Vector2d(1, 0)) - vignetted(p - Eigen::Vector2d(1, 0))) / 2,
        (vignetted(p + Eigen::Vector2d(0, 1)) - vignetted(p - Eigen::Vector2d(0, 1))) / 2);
    EXPECT_LT((level.gradient - slope).norm(), 0.01);  // of 0.06 at the rim
    EXPECT_LT(level.variance, 0.3);
  }
}

TEST(LevelSurface, FewOutliersDoNotBendIt) {
  TestRng rng;
  auto seen = samples(rng, 100, 0.5);
  for (size_t i = 0; i < 15; ++i) seen[i].value -= 60;  // in shadow
  LevelSurface surface;
  surface.fit(seen);
  EXPECT_NEAR(surface.at({300, 250}).value, vignetted({300, 250}), 1.5);
}

// A hard shadow over half of them: no surface is right, and none is believed.
TEST(LevelSurface, BindsNobodyWhereSamplesDisagree) {
  TestRng rng;
  auto seen = samples(rng, 100, 0.5);
  for (LevelSample& s : seen) s.value *= rng.index(2) == 0 ? 1 : 0.4;
  LevelSurface surface;
  surface.fit(seen);
  EXPECT_GT(surface.at({300, 250}).variance, 100);
}

TEST(LevelSurface, KnowsNothingFromTooFew) {
  TestRng rng;
  LevelSurface surface;
  surface.fit(samples(rng, 7, 0.5));
  EXPECT_GT(surface.at({300, 250}).variance, 1e5);
  std::vector<LevelSample> one_place(30, {{10, 10}, 100, 1});
  surface.fit(one_place);
  EXPECT_TRUE(std::isfinite(surface.at({10, 10}).value));
}

}  // namespace
}  // namespace perch
