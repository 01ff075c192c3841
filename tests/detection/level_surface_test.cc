#include "perch/detection/level_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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
    const auto level = surface.at(p, 130);
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
  EXPECT_NEAR(surface.at({300, 250}, 130).value, vignetted({300, 250}), 1.5);
}

// Half of them in a hard shadow, some in its soft edge: the surface is bent by neither, and each place has
// the level of its own side.
TEST(LevelSurface, TellsAShadowFromTheLight) {
  for (const double shade : {0.3, 0.6}) {
    for (const double direction : {0.0, 0.7, 2.0}) {
      TestRng rng;
      auto seen = samples(rng, 100, 0.5);
      const auto light = [&](const Eigen::Vector2d& p) {
        const double out = std::cos(direction) * (p.x() - 290) + std::sin(direction) * (p.y() - 260);
        return shade + (1 - shade) * std::clamp(out / 20, 0.0, 1.0);
      };
      for (LevelSample& s : seen) s.value *= light(s.pixel);
      LevelSurface surface;
      surface.fit(seen);
      for (int i = 0; i < 100; ++i) {
        const Eigen::Vector2d p(rng.uniform(170, 430), rng.uniform(120, 380));
        if (light(p) > shade && light(p) < 1) continue;
        const double expected = light(p) * vignetted(p);
        const auto level = surface.at(p, expected + rng.normal(3));
        EXPECT_NEAR(level.value, expected, 1.5);  // twice as far off as without, for half as many
        const Eigen::Vector2d slope =
            light(p) * Eigen::Vector2d(12 / 600.0 - 120 * (p.x() - 320) / 36e4, -120 * (p.y() - 240) / 36e4);
        // A compromise between both sides would have 0.3.
        EXPECT_LT((level.gradient - slope).norm(), 0.02);
      }
    }
  }
}

// Three kinds of light anywhere: no surface is right, and none is believed.
TEST(LevelSurface, BindsNobodyWhereSamplesDisagree) {
  TestRng rng;
  auto seen = samples(rng, 100, 0.5);
  for (LevelSample& s : seen) s.value *= 1 - 0.3 * rng.index(3);
  LevelSurface surface;
  surface.fit(seen);
  EXPECT_GT(surface.at({300, 250}, 90).variance, 100);
  EXPECT_GT(surface.at({300, 250}, 90).gradient_sigma, 0.5);
}

TEST(LevelSurface, KnowsNothingFromTooFew) {
  TestRng rng;
  LevelSurface surface;
  surface.fit(samples(rng, 7, 0.5));
  EXPECT_GT(surface.at({300, 250}, 130).variance, 1e5);
  std::vector<LevelSample> one_place(30, {{10, 10}, 100, 1});
  surface.fit(one_place);
  EXPECT_TRUE(std::isfinite(surface.at({10, 10}, 130).value));
}

}  // namespace
}  // namespace perch
