#include "perch/simulation/patch_map.h"

#include <gmock/gmock.h>

#include <cmath>

#include "simulation/sharp_target.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

// By a fine raster of points: within 1 / side of the share that an edge cuts.
Coverage by_points(const std::vector<Patch>& patches, const Quad& q, int side) {
  Coverage sum;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const double s = (i + 0.5) / side, t = (j + 0.5) / side;
      const Eigen::Vector2d p = (1 - t) * ((1 - s) * q[0] + s * q[1]) + t * ((1 - s) * q[3] + s * q[2]);
      for (size_t k = patches.size(); k-- > 0;) {
        bool inside = true;
        const Quad& c = patches[k].corners;
        for (size_t e = 0; e < 4; ++e) {
          const Eigen::Vector2d a = c[(e + 1) % 4] - c[e], b = p - c[e];
          inside = inside && a.x() * b.y() - a.y() * b.x() >= 0;
        }
        if (!inside) continue;
        (patches[k].white ? sum.white : sum.black) += 1.0 / (side * side);
        break;
      }
    }
  }
  return sum;
}

Quad small_square(const Eigen::Vector2d& centre, double side, double angle) {
  const Eigen::Vector2d a = side / 2 * Eigen::Vector2d(std::cos(angle), std::sin(angle)), b(-a.y(), a.x());
  return {centre + a + b, centre - a + b, centre - a - b, centre + a - b};
}

TEST(PatchMap, HalvesAPixelOnAnEdge) {
  const PatchMap map(sharp_target().patches);
  const Quad half_out = square_corners({0.49, 0.1}, 0.02);  // the border ends at x = 0.5
  EXPECT_NEAR(map.mean(half_out).white, 0.5, 1e-12);
  EXPECT_NEAR(map.mean(half_out).black, 0, 1e-12);
  const Quad quarter = square_corners({0.24, 0.24}, 0.02);  // the upper right corner of A, at (0.25, 0.25)
  EXPECT_NEAR(map.mean(quarter).white, 0.25, 1e-12);
  EXPECT_NEAR(map.mean(quarter).black, 0.75, 1e-12);
}

TEST(PatchMap, AgreesWithAFineRasterOfPoints) {
  const auto target = sharp_target();
  const PatchMap map(target.patches);
  TestRng rng;
  for (int i = 0; i < 300; ++i) {
    // From a pixel close by to one that sees a quarter of the target.
    const double size = std::exp(rng.uniform(std::log(0.002), std::log(0.3)));
    const Eigen::Vector2d centre(rng.uniform(-0.55, 0.55), rng.uniform(-0.55, 0.55));
    const Quad area = small_square(centre, size, rng.uniform(0, 2 * M_PI));
    const Coverage exact = map.mean(area), points = by_points(target.patches, area, 200);
    // An edge cuts some 200 of the 40000 points' squares, each off by at most half: far below 1 / 200.
    EXPECT_NEAR(exact.white, points.white, 0.005) << centre.transpose() << " size " << size;
    EXPECT_NEAR(exact.black, points.black, 0.005) << centre.transpose() << " size " << size;
  }
}

TEST(PatchMap, PaintsLaterOverEarlierHoweverTheyOverlap) {
  const std::vector<Patch> patches{{square_corners({0, 0}, 1), true},
                                   {small_square({1, 0.5}, 0.8, 0.4), false},   // half over the first
                                   {small_square({0.8, 0.6}, 0.5, 1.1), true},  // over both
                                   {square_corners({0.7, 0.7}, 0.1), true}};    // inside one of its colour
  const PatchMap map(patches);
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const Quad area = small_square({rng.uniform(-0.2, 1.6), rng.uniform(-0.2, 1.2)}, rng.uniform(0.02, 1),
                                   rng.uniform(0, 6));
    const Coverage exact = map.mean(area), points = by_points(patches, area, 200);
    EXPECT_NEAR(exact.white, points.white, 0.005);
    EXPECT_NEAR(exact.black, points.black, 0.005);
  }
}

TEST(PatchMap, DoesNotCareForTheSenseOfRotation) {
  auto patches = sharp_target().patches;
  const PatchMap map(patches);
  for (auto& patch : patches) std::reverse(patch.corners.begin(), patch.corners.end());
  const PatchMap reversed(patches);
  Quad area = small_square({0.26, 0.2}, 0.2, 0.3);
  const double white = map.mean(area).white;
  EXPECT_NEAR(reversed.mean(area).white, white, 1e-12);
  std::reverse(area.begin(), area.end());
  EXPECT_NEAR(map.mean(area).white, white, 1e-12);
}

TEST(PatchMap, CallsUniformOnlyWhatIs) {
  const PatchMap map(sharp_target().patches);
  TestRng rng;
  int answered = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector2d point(rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6));
    const double radius = std::exp(rng.uniform(std::log(0.0005), std::log(0.05)));
    const auto uniform = map.uniform(point, radius);
    if (!uniform) continue;
    ++answered;
    // The square around the circle would reach out of it; the one within shows any edge near its corners.
    const Coverage exact = map.mean(small_square(point, radius * M_SQRT2, rng.uniform(0, 6)));
    ASSERT_NEAR(exact.white, uniform->white, 1e-9) << point.transpose() << " radius " << radius;
    ASSERT_NEAR(exact.black, uniform->black, 1e-9) << point.transpose() << " radius " << radius;
  }
  EXPECT_GT(answered, 10000);  // it is there to answer most
}

TEST(PatchMap, WithoutPatchesIsGround) {
  const PatchMap map({});
  EXPECT_EQ(map.mean(square_corners({0, 0}, 1)).white, 0);
  ASSERT_TRUE(map.uniform({0, 0}, 1));
  EXPECT_EQ(map.uniform({0, 0}, 1)->black, 0);
}

}  // namespace
}  // namespace perch
