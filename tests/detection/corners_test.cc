#include "perch/detection/corners.h"

#include <algorithm>
#include <vector>

#include "support/rng.h"

namespace perch {
namespace {

using Points = std::vector<Eigen::Vector2d>;
using Corners = std::array<Eigen::Vector2d, 4>;

// The ends of the rows of the pixels whose centres lie inside a convex polygon (counterclockwise to the eye,
// y down), and the pixels' centre of gravity.
struct Raster {
  Points outline;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
};

Raster rasterise(const Corners& corners) {
  Raster raster;
  double low = corners[0].y(), high = low;
  for (const auto& c : corners) {
    low = std::min(low, c.y());
    high = std::max(high, c.y());
  }
  double pixels = 0;
  for (double y = std::ceil(low); y <= high; ++y) {
    double left = -1e9, right = 1e9;
    for (size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d& a = corners[i];
      const Eigen::Vector2d& b = corners[(i + 1) % 4];
      const double dy = b.y() - a.y();
      // Counterclockwise: a side that falls in the picture bounds on the left, one that rises on the right.
      if (dy == 0) continue;
      const double x = a.x() + (y - a.y()) / dy * (b.x() - a.x());
      (dy > 0 ? left : right) = dy > 0 ? std::max(left, x) : std::min(right, x);
    }
    const double begin = std::ceil(left), end = std::floor(right);
    if (begin > end) continue;
    raster.outline.emplace_back(begin, y);
    raster.outline.emplace_back(end, y);
    raster.centre += (end - begin + 1) * Eigen::Vector2d((begin + end) / 2, y);
    pixels += end - begin + 1;
  }
  raster.centre /= pixels;
  return raster;
}

// A square turned by `angle`, counterclockwise to the eye.
Corners square_at(const Eigen::Vector2d& centre, double side, double angle) {
  Corners corners;
  for (size_t i = 0; i < 4; ++i) {
    const double a = angle - M_PI / 4 - M_PI / 2 * static_cast<double>(i);  // y down
    corners[i] = centre + side * M_SQRT1_2 * Eigen::Vector2d(std::cos(a), std::sin(a));
  }
  return corners;
}

// The largest distance between corners of the same place, whichever the seen ones start with; infinite when
// they come in another order.
double worst_distance(const Corners& seen, const Corners& expected) {
  double best = INFINITY;
  for (size_t shift = 0; shift < 4; ++shift) {
    double worst = 0;
    for (size_t i = 0; i < 4; ++i) worst = std::max(worst, (seen[(i + shift) % 4] - expected[i]).norm());
    best = std::min(best, worst);
  }
  return best;
}

// How far a pixel taken for a corner of this angle can lie from it. A disc of radius sqrt(1/2) holds a pixel
// centre wherever it is; the one that touches both sides has its centre sqrt(1/2) / sin(angle / 2) from the
// tip. So some pixel, and with it the outermost, lies no deeper than that and a radius more, and there the
// corner is so wide.
double farthest_pixel(double angle) {
  return M_SQRT1_2 * (1 + 1 / std::sin(angle / 2)) / std::cos(angle / 2);
}

TEST(QuadCorners, AreThoseOfSquaresTurnedToEveryAngle) {
  TestRng rng;
  double inset = 0;
  constexpr int kCount = 3600;
  for (int i = 0; i < kCount; ++i) {
    const double side = rng.uniform(6, 60);
    const Corners corners =
        square_at({rng.uniform(90, 110), rng.uniform(90, 110)}, side, i * 2 * M_PI / kCount);
    const Raster raster = rasterise(corners);
    const auto seen = quad_corners(raster.outline, raster.centre);
    ASSERT_TRUE(seen) << i;
    EXPECT_LE(worst_distance(*seen, corners), farthest_pixel(M_PI / 2)) << i << ", side " << side;
    for (const auto& c : *seen) inset += side * M_SQRT1_2 - (c - raster.centre).norm();
  }
  // What PaperOptions::corner_inset_px says of it. 14400 corners that scatter by 0.3 px; four sigma.
  EXPECT_NEAR(inset / (4 * kCount), 0.7, 0.02);
}

// Each of the six squares of a frame, thirty times a second, needs this: a side that is parallel to an axis
// but for one step, for which many pixels are equally far from it.
TEST(QuadCorners, AreThoseOfSquaresNearlyParallelToTheAxes) {
  TestRng rng;
  for (int i = 0; i < 4000; ++i) {
    const double side = rng.uniform(6, 60);
    const double angle = rng.index(4) * M_PI / 2 + rng.uniform(-0.07, 0.07);
    const Corners corners = square_at({rng.uniform(90, 110), rng.uniform(90, 110)}, side, angle);
    const Raster raster = rasterise(corners);
    const auto seen = quad_corners(raster.outline, raster.centre);
    ASSERT_TRUE(seen);
    EXPECT_LE(worst_distance(*seen, corners), farthest_pixel(M_PI / 2)) << angle << " rad, side " << side;
  }
}

TEST(QuadCorners, DoNotTakeASpeckOnASideForOne) {
  for (int at = 4; at <= 16; ++at) {
    Points outline;
    for (int y = 0; y <= 20; ++y) {
      outline.emplace_back(y == at ? 9 : 10, y);
      outline.emplace_back(30, y);
    }
    const auto seen = quad_corners(outline, {20, 10});
    ASSERT_TRUE(seen);
    const Corners corners{Eigen::Vector2d(30, 0), Eigen::Vector2d(10, 0), Eigen::Vector2d(10, 20),
                          Eigen::Vector2d(30, 20)};
    EXPECT_EQ(worst_distance(*seen, corners), 0) << "at row " << at;
  }
}

TEST(QuadCorners, AreExactForSquaresParallelToTheAxes) {
  for (int width = 2; width < 20; ++width) {
    for (int height = 2; height < 20; ++height) {
      const Corners corners{Eigen::Vector2d(50 + width - 1, 30), Eigen::Vector2d(50, 30),
                            Eigen::Vector2d(50, 30 + height - 1),
                            Eigen::Vector2d(50 + width - 1, 30 + height - 1)};
      const Raster raster = rasterise(corners);
      const auto seen = quad_corners(raster.outline, raster.centre);
      ASSERT_TRUE(seen) << width << " x " << height;
      EXPECT_EQ(worst_distance(*seen, corners), 0) << width << " x " << height;
    }
  }
}

TEST(QuadCorners, AreExactForSquaresOnTheirTips) {
  for (int half = 1; half < 20; ++half) {
    const Corners corners{Eigen::Vector2d(50 + half, 50), Eigen::Vector2d(50, 50 - half),
                          Eigen::Vector2d(50 - half, 50), Eigen::Vector2d(50, 50 + half)};
    const Raster raster = rasterise(corners);
    const auto seen = quad_corners(raster.outline, raster.centre);
    ASSERT_TRUE(seen) << half;
    EXPECT_EQ(worst_distance(*seen, corners), 0) << half;
  }
}

// The images of a square under perspective: convex, angles between 60 and 120 degrees.
TEST(QuadCorners, AreThoseOfConvexQuadrilaterals) {
  TestRng rng;
  int tried = 0;
  while (tried < 2000) {
    Corners corners = square_at({100, 100}, rng.uniform(15, 60), rng.uniform(0, 2 * M_PI));
    const double side = (corners[0] - corners[1]).norm();
    for (auto& c : corners) c += side * Eigen::Vector2d(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2));
    double narrowest = M_PI, widest = 0;
    for (size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d a = corners[(i + 3) % 4] - corners[i], b = corners[(i + 1) % 4] - corners[i];
      const double angle = std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
      narrowest = std::min(narrowest, angle);
      widest = std::max(widest, angle);
    }
    if (narrowest < M_PI / 3 || widest > 2 * M_PI / 3) continue;
    ++tried;
    const Raster raster = rasterise(corners);
    const auto seen = quad_corners(raster.outline, raster.centre);
    ASSERT_TRUE(seen);
    EXPECT_LE(worst_distance(*seen, corners), farthest_pixel(2 * M_PI / 3));
  }
}

TEST(QuadCorners, ComeCounterclockwiseToTheEye) {
  TestRng rng;
  for (int i = 0; i < 500; ++i) {
    const Raster raster = rasterise(square_at({50, 50}, rng.uniform(4, 40), rng.uniform(0, 2 * M_PI)));
    const auto seen = quad_corners(raster.outline, raster.centre);
    ASSERT_TRUE(seen);
    double twice_area = 0;
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d &a = (*seen)[k], &b = (*seen)[(k + 1) % 4];
      twice_area += a.x() * b.y() - a.y() * b.x();
    }
    EXPECT_LT(twice_area, 0);  // y points down
  }
}

TEST(QuadCorners, AreNoneWhereThePointsSpanNoQuadrilateral) {
  const auto corners_of = [](const Points& outline) {
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (const auto& p : outline) centre += p / static_cast<double>(outline.size());
    return quad_corners(outline, centre);
  };
  EXPECT_FALSE(corners_of({}));
  EXPECT_FALSE(corners_of({{1, 1}, {2, 1}, {1, 2}}));
  EXPECT_FALSE(corners_of({{1, 1}, {1, 1}, {1, 1}, {1, 1}}));                  // one pixel
  EXPECT_FALSE(corners_of({{0, 3}, {9, 3}, {2, 3}, {5, 3}}));                  // a row
  EXPECT_FALSE(corners_of({{3, 0}, {3, 9}, {3, 2}, {3, 5}}));                  // a column
  EXPECT_FALSE(corners_of({{0, 0}, {0, 0}, {1, 1}, {1, 1}, {2, 2}, {2, 2}}));  // a slope
  EXPECT_FALSE(corners_of({{0, 0}, {0, 0}, {0, 1}, {1, 1}, {0, 2}, {2, 2}}));  // a triangle
  EXPECT_FALSE(corners_of({{0, 0}, {NAN, 0}, {0, NAN}, {NAN, NAN}}));
}

}  // namespace
}  // namespace perch
