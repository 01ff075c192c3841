#include "perch/geometry/homography.h"

#include <Eigen/Dense>
#include <limits>
#include <vector>

#include "perch/geometry/so3.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

using Points = std::vector<Eigen::Vector2d>;

const Points kSquare{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};

Points map(const Eigen::Matrix3d& H, const Points& points) {
  Points mapped;
  for (const auto& p : points) mapped.push_back(apply(H, p));
  return mapped;
}

// H is known up to its sign and size only.
MATCHER_P2(IsTheSameMap, expected, tolerance, "") {
  if (!arg) return false;
  const Eigen::Matrix3d a = *arg / arg->norm(), b = expected / expected.norm();
  const double off = std::min((a - b).norm(), (a + b).norm());
  *result_listener << "off by " << off;
  return a.allFinite() && off <= tolerance;
}

// The plane z = 0 seen by a camera 5 m away, tilted by up to 60 degrees, some 1000 px wide.
Eigen::Matrix3d random_view(TestRng& rng) {
  Eigen::Matrix3d K;
  K << 800, 0, 640, 0, 800, 480, 0, 0, 1;
  Eigen::Vector3d axis = rng.normal3();
  const Eigen::Matrix3d R = so3_exp(axis.normalized() * rng.uniform(0, 1)).toRotationMatrix();
  Eigen::Matrix3d view;
  view << R.col(0), R.col(1), Eigen::Vector3d(rng.normal(0.3), rng.normal(0.3), 5);
  return K * view;
}

TEST(Homography, OfAShiftedAndScaledSquareIsThatByHand) {
  Eigen::Matrix3d expected;
  expected << 2, 0, 10, 0, 3, -5, 0, 0, 1;
  const auto H = homography_from_points(kSquare, map(expected, kSquare));
  // The normal equations square the condition, some 10: a hundred epsilons, of numbers up to 10.
  EXPECT_THAT(H, IsTheSameMap(expected, 1000 * kEpsilon));
  EXPECT_NEAR(H->norm(), 1, 4 * kEpsilon);
}

TEST(Homography, OfFourExactPointsMapsThemExactly) {
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    const Points pixels = map(random_view(rng), kSquare);
    const auto H = homography_from_points(kSquare, pixels);
    ASSERT_TRUE(H);
    for (size_t k = 0; k < 4; ++k) {
      // Condition^2 some 1e4, of 1000 px.
      EXPECT_LE((apply(*H, kSquare[k]) - pixels[k]).norm(), 1e4 * kEpsilon * 1000);
    }
  }
}

TEST(Homography, OfManyExactPointsIsTheView) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    Points plane;
    for (int k = 0; k < 24; ++k) plane.emplace_back(rng.uniform(-1, 1), rng.uniform(-1, 1));
    const Eigen::Matrix3d view = random_view(rng);
    EXPECT_THAT(homography_from_points(plane, map(view, plane)), IsTheSameMap(view, 1e4 * kEpsilon));
  }
}

TEST(Homography, BackwardIsTheInverseOfForward) {
  TestRng rng;
  const Points pixels = map(random_view(rng), kSquare);
  const auto forward = homography_from_points(kSquare, pixels);
  const auto backward = homography_from_points(pixels, kSquare);
  ASSERT_TRUE(forward && backward);
  // The inverse multiplies by the view's own condition, some 1e5 in raw pixels.
  EXPECT_THAT(backward, IsTheSameMap(forward->inverse().eval(), 1e9 * kEpsilon));
}

TEST(Homography, AveragesNoiseOverManyPoints) {
  TestRng rng;
  Points plane;
  for (int k = 0; k < 400; ++k) plane.emplace_back(rng.uniform(-1, 1), rng.uniform(-1, 1));
  const Eigen::Matrix3d view = random_view(rng);
  Points pixels = map(view, plane);
  for (auto& q : pixels) q += Eigen::Vector2d(rng.normal(0.5), rng.normal(0.5));
  const auto H = homography_from_points(plane, pixels);
  ASSERT_TRUE(H);
  // Eight numbers from 800: 0.5 px * sqrt(8 / 800) = 0.05 px on average; four times that at the centre.
  EXPECT_LE((apply(*H, {0, 0}) - apply(view, {0, 0})).norm(), 0.2);
}

TEST(Homography, RefusesFewerThanFourPairsOrUnequalSizes) {
  const Points three(kSquare.begin(), kSquare.begin() + 3);
  EXPECT_FALSE(homography_from_points(three, three));
  EXPECT_FALSE(homography_from_points(kSquare, three));
  EXPECT_FALSE(homography_from_points({}, {}));
}

TEST(Homography, RefusesPointsInALineOrInOnePlace) {
  TestRng rng;
  Points line, scattered;
  for (int k = 0; k < 10; ++k) {
    line.emplace_back(0.3 * k, 1 - 0.7 * k);
    scattered.push_back(rng.normal3().head<2>());
  }
  EXPECT_FALSE(homography_from_points(line, scattered));
  EXPECT_FALSE(homography_from_points(scattered, line));
  EXPECT_FALSE(homography_from_points(line, line));
  EXPECT_FALSE(homography_from_points(Points(5, {1, 2}), Points(5, {1, 2})));
}

TEST(Homography, RefusesFourPairsWithThreeInALine) {
  const Points three_in_line{{-1, 0}, {0, 0}, {1, 0}, {0, 1}};
  EXPECT_FALSE(homography_from_points(three_in_line, three_in_line));
  EXPECT_FALSE(homography_from_points(three_in_line, kSquare));
  EXPECT_FALSE(homography_from_points(kSquare, three_in_line));
}

TEST(Homography, RefusesOnePointGivenTwice) {
  Points twice = kSquare;
  twice[3] = twice[2];
  EXPECT_FALSE(homography_from_points(twice, twice));
}

TEST(Homography, TakesAViewOneDegreeFromThePlane) {
  // Flat as it is, such a view is exact and must not count as degenerate.
  Points flat;
  for (const auto& p : kSquare) flat.emplace_back(p.x(), p.y() * std::sin(0.0175));
  const auto H = homography_from_points(kSquare, flat);
  ASSERT_TRUE(H);
  EXPECT_LE((apply(*H, kSquare[0]) - flat[0]).norm(), 1e6 * kEpsilon);
}

TEST(Homography, RefusesNumbersThatAreNotFinite) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e308}) {
    Points points = kSquare;
    points[2].x() = bad;
    EXPECT_FALSE(homography_from_points(points, kSquare)) << bad;
    EXPECT_FALSE(homography_from_points(kSquare, points)) << bad;
  }
}

TEST(Homography, WorksFarFromTheOriginAndAtAnyScale) {
  TestRng rng;
  for (const double scale : {1e-6, 1.0, 1e6}) {
    Points plane;
    for (const auto& p : kSquare) plane.push_back(scale * (p + Eigen::Vector2d(1000, 0)));
    const auto H = homography_from_points(plane, kSquare);
    ASSERT_TRUE(H) << scale;
    // 1000 from the origin costs three digits.
    EXPECT_LE((apply(*H, plane[1]) - kSquare[1]).norm(), 1e4 * kEpsilon * 1000) << scale;
  }
}

TEST(Homography, ApplyIsNotFiniteOnTheHorizon) {
  Eigen::Matrix3d H;
  H << 1, 0, 0, 0, 1, 0, 1, 0, 0;
  EXPECT_FALSE(apply(H, {0, 1}).allFinite());
}

}  // namespace
}  // namespace perch
