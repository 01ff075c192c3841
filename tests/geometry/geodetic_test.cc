#include "perch/geometry/geodetic.h"

#include <gtest/gtest.h>

#include "perch/geometry/euler.h"
#include "support/rng.h"

namespace perch {
namespace {

constexpr double kA = 6378137.0, kB = 6356752.314245179;  // WGS84's semi-axes, m

TEST(LocalFrame, TheOriginIsZeroAndHeightIsUp) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const Geodetic origin{rng.uniform(-1.57, 1.57), rng.uniform(-3.14, 3.14), rng.uniform(-100, 5000)};
    const LocalFrame frame(origin);
    EXPECT_EQ(frame.ned(origin).norm(), 0);
    Geodetic above = origin;
    above.height += 30;
    // Rounding alone: epsilons of the earth's radius.
    EXPECT_LT((frame.ned(above) - Eigen::Vector3d(0, 0, -30)).norm(), 1e-8);
  }
}

// An independent way to the same place: arcs along the meridian and the parallel, of the ellipse's own radii
// of curvature M = a^2 b^2 / (a^2 cos^2 + b^2 sin^2)^(3/2) and N cos.
TEST(LocalFrame, SmallStepsNorthAndEastAreArcsOfTheEllipsoid) {
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    const Geodetic origin{rng.uniform(-1.4, 1.4), rng.uniform(-3.1, 3.1), rng.uniform(0, 3000)};
    const double c = std::cos(origin.latitude), s = std::sin(origin.latitude);
    const double w = std::sqrt(kA * kA * c * c + kB * kB * s * s);
    const double meridian = kA * kA * kB * kB / (w * w * w), normal = kA * kA / w;
    const double north = rng.uniform(-50, 50), east = rng.uniform(-50, 50);
    const Geodetic place{origin.latitude + north / (meridian + origin.height),
                         origin.longitude + east / ((normal + origin.height) * c), origin.height};
    const Eigen::Vector3d ned = LocalFrame(origin).ned(place);
    // The parallel bends towards the pole and the plane leaves the ellipsoid: d^2 tan / (2 R) and d^2 / (2
    // R), at d = 71 m and latitude 80 degrees 2.3 mm.
    EXPECT_NEAR(ned.x(), north, 3e-3);
    EXPECT_NEAR(ned.y(), east, 3e-3);
    EXPECT_NEAR(ned.z(), (north * north + east * east) / (2 * kA), 2e-5);
  }
}

TEST(LocalFrame, TheEarthsSizeShows) {
  // From the equator to the pole: b to the north and a down.
  const Eigen::Vector3d pole = LocalFrame({0, 0, 0}).ned({90 * kRadFromDeg, 0, 0});
  EXPECT_NEAR(pole.x(), kB, 1e-6);
  EXPECT_NEAR(pole.z(), kA, 1e-6);
  // A quarter round the equator: a to the east and a down.
  const Eigen::Vector3d quarter = LocalFrame({0, 0, 0}).ned({0, 90 * kRadFromDeg, 0});
  EXPECT_NEAR(quarter.y(), kA, 1e-6);
  EXPECT_NEAR(quarter.z(), kA, 1e-6);
}

}  // namespace
}  // namespace perch
