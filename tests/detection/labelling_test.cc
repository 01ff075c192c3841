#include "perch/detection/labelling.h"

#include <algorithm>

#include "perch/geometry/euler.h"
#include "support/drawing.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

const LandingTarget kSharp = sharp_target();

const SquaresLayout& sharp_layout() { return std::get<SquaresLayout>(kSharp.layout); }

CameraModel camera() { return CameraModel::pinhole(600, 600, 320, 240, 640, 480); }

// The centre of gravity of a quadrilateral.
Eigen::Vector2d centroid(const std::array<Eigen::Vector2d, 4>& corners) {
  double area = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = corners[i] - corners[0], b = corners[(i + 1) % 4] - corners[0];
    const double piece = a.x() * b.y() - a.y() * b.x();
    area += piece;
    sum += piece * (a + b) / 3;
  }
  return corners[0] + sum / area;
}

// The squares as a camera sees them, in the layout's order, each with its corners in its features' order.
std::vector<SeenSquare> squares_of(const SquaresLayout& layout, const CameraModel& camera,
                                   const Rigid3& camera_from_target) {
  std::vector<SeenSquare> squares;
  for (const auto& square : layout.squares) {
    SeenSquare seen;
    const Quad corners = square_corners(square.lower_left, square.side);
    for (size_t k = 0; k < 4; ++k) seen.corners[k] = seen_at(camera, camera_from_target, corners[k]);
    seen.centre = centroid(seen.corners);
    squares.push_back(seen);
  }
  return squares;
}

// What the detector knows of them: they come in any order, their corners start anywhere.
std::vector<SeenSquare> shuffled(std::vector<SeenSquare> squares, TestRng& rng) {
  for (size_t i = squares.size(); i > 1; --i) {
    std::swap(squares[i - 1], squares[static_cast<size_t>(rng.index(static_cast<int>(i)))]);
  }
  for (auto& s : squares) std::rotate(s.corners.begin(), s.corners.begin() + rng.index(4), s.corners.end());
  return squares;
}

bool same(const std::vector<SeenSquare>& a, const std::vector<SeenSquare>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const SeenSquare& p, const SeenSquare& q) {
    return p.centre == q.centre && p.corners == q.corners;
  });
}

std::vector<SeenSquare> labelled_of(const std::vector<SeenSquare>& seen) {
  std::vector<SeenSquare> labelled;
  const bool all = Labelling::of(sharp_layout())->label(seen, labelled);
  EXPECT_EQ(labelled.size(), all ? seen.size() : 0);
  return labelled;
}

TEST(Labelling, NamesEverySquareAndCornerAtAnyTiltAndYaw) {
  TestRng rng;
  for (int tilt = 0; tilt <= 75; tilt += 5) {
    for (int i = 0; i < 200; ++i) {
      const Rigid3 pose =
          looking_pose(rng.uniform(1.5, 8), tilt * kRadFromDeg, rng.uniform(0, 2 * M_PI),
                       rng.uniform(0, 2 * M_PI), {rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)});
      const auto truth = squares_of(sharp_layout(), camera(), pose);
      ASSERT_TRUE(same(labelled_of(shuffled(truth, rng)), truth)) << "tilt " << tilt << ", pose " << i;
    }
  }
}

// Corners half a pixel off, and centres by as much as the mean of four of them, on squares of 8 px.
TEST(Labelling, WithstandsNoiseOnSquaresOfEightPixels) {
  TestRng rng;
  int labelled = 0;
  for (int i = 0; i < 2000; ++i) {
    // 0.1 m are 8 px at 7.5 m.
    const Rigid3 pose = looking_pose(7.5, rng.uniform(0, 30) * kRadFromDeg, rng.uniform(0, 2 * M_PI),
                                     rng.uniform(0, 2 * M_PI));
    auto truth = squares_of(sharp_layout(), camera(), pose);
    for (auto& s : truth) {
      Eigen::Vector2d mean = Eigen::Vector2d::Zero();
      for (auto& c : s.corners) {
        const Eigen::Vector2d noise(rng.normal(0.5), rng.normal(0.5));
        c += noise;
        mean += noise / 4;
      }
      s.centre += mean;
    }
    const auto result = labelled_of(shuffled(truth, rng));
    if (result.empty()) continue;
    ++labelled;
    ASSERT_TRUE(same(result, truth)) << "pose " << i;  // refused perhaps, mistaken never
  }
  // Two centres off by 0.25 px each, 14 px apart, turn a ray by 0.025: kSameRay, 0.1, is four sigma.
  EXPECT_GE(labelled, 1990);
}

// The layout is its own mirror image about the line from D to A, so a mirrored picture shows a target with
// the names B and F, C and E exchanged, and nothing tells that from the true one.
TEST(Labelling, CannotTellAMirroredPicture) {
  TestRng rng;
  auto truth = squares_of(sharp_layout(), camera(), looking_pose(3, 0.4, 1, 2));
  for (auto& s : truth) {
    s.centre.x() = 639 - s.centre.x();
    for (auto& c : s.corners) c.x() = 639 - c.x();
    std::reverse(s.corners.begin(), s.corners.end());  // counterclockwise to the eye again
  }
  const auto result = labelled_of(shuffled(truth, rng));
  ASSERT_EQ(result.size(), 6u);
  const size_t mirrored[] = {0, 5, 4, 3, 2, 1};
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(result[i].centre, truth[mirrored[i]].centre) << i;
}

TEST(Labelling, RefusesASquareSeenTwice) {
  TestRng rng;
  const auto truth = squares_of(sharp_layout(), camera(), looking_pose(3, 0.4, 1, 2));
  for (size_t lost = 0; lost < 6; ++lost) {
    for (size_t twice = 0; twice < 6; ++twice) {
      if (twice == lost) continue;
      auto seen = truth;
      seen[lost] = seen[twice];
      EXPECT_TRUE(labelled_of(shuffled(seen, rng)).empty()) << lost << " shown as " << twice;
    }
  }
}

TEST(Labelling, RefusesAnyOtherNumberOfSquares) {
  const auto truth = squares_of(sharp_layout(), camera(), looking_pose(3, 0.4, 1, 2));
  for (size_t n = 0; n < 6; ++n) {
    EXPECT_TRUE(labelled_of({truth.begin(), truth.begin() + static_cast<std::ptrdiff_t>(n)}).empty());
  }
  for (size_t more = 1; more < 20; ++more) {
    auto seen = truth;
    for (size_t i = 0; i < more; ++i) {
      seen.push_back(truth[i % 6]);
      seen.back().centre += Eigen::Vector2d(100 + 10.0 * static_cast<double>(i), 37);
    }
    EXPECT_TRUE(labelled_of(seen).empty());
  }
}

TEST(Labelling, RefusesSquaresWithoutAnAnchor) {
  TestRng rng;
  auto seen = squares_of(sharp_layout(), camera(), looking_pose(3, 0, 0, 0));
  auto hexagon = seen;
  for (size_t i = 0; i < 6; ++i) {
    const double a = 0.3 + static_cast<double>(i) + 0.05 * static_cast<double>(i * i);
    hexagon[i].centre = Eigen::Vector2d(320 + 100 * std::cos(a), 240 + 100 * std::sin(a));
  }
  EXPECT_TRUE(labelled_of(hexagon).empty());
  auto row = seen;
  for (size_t i = 0; i < 6; ++i) row[i].centre = Eigen::Vector2d(100 + 40.0 * static_cast<double>(i), 200);
  EXPECT_TRUE(labelled_of(row).empty());
  seen[2].centre.x() = NAN;
  EXPECT_TRUE(labelled_of(seen).empty());
}

TEST(Labelling, SurvivesAnySixPoints) {
  TestRng rng;
  auto seen = squares_of(sharp_layout(), camera(), looking_pose(3, 0, 0, 0));
  for (int i = 0; i < 5000; ++i) {
    for (auto& s : seen) {
      s.centre = {static_cast<double>(rng.index(12)), static_cast<double>(rng.index(12))};
      for (auto& c : s.corners) c = {static_cast<double>(rng.index(12)), static_cast<double>(rng.index(12))};
    }
    const size_t n = labelled_of(seen).size();
    EXPECT_TRUE(n == 0 || n == 6);
  }
}

TEST(LabellingOf, NeedsALayoutWithOneAnchor) {
  const auto layout_of = [](const std::vector<Eigen::Vector2d>& centres) {
    SquaresLayout layout;
    for (const auto& c : centres) layout.squares.push_back({"?", c - Eigen::Vector2d(0.05, 0.05), 0.1});
    return layout;
  };
  EXPECT_TRUE(Labelling::of(sharp_layout()));
  EXPECT_FALSE(Labelling::of({}));
  EXPECT_FALSE(Labelling::of(layout_of({{0, 0}, {1, 0}, {2, 0}, {0, 1}})));                    // too few
  EXPECT_FALSE(Labelling::of(layout_of({{0, 0}, {1, 0}, {2, 0}, {0, 1}, {1, 1}, {2, 1}})));    // a grid
  EXPECT_FALSE(Labelling::of(layout_of({{0, 0}, {1, 0.1}, {2.2, 0}, {0.3, 1}, {1.5, 1.2}})));  // no lines
  EXPECT_FALSE(
      Labelling::of(layout_of({{0, 0}, {-1, 0}, {1, 0}, {0, 1}, {0, -1}, {0.7, 0.3}})))  // all around
      << "perspective could move the widest gap";
  std::vector<Eigen::Vector2d> many{{0, 0}, {1, 0}, {2, 0}, {0, 1}, {0, 2}};
  EXPECT_TRUE(Labelling::of(layout_of(many)));
  for (int i = 0; i < 12; ++i) many.emplace_back(1 + 0.37 * i, 1 + 0.1 * i * i);
  EXPECT_FALSE(Labelling::of(layout_of(many)));  // 17
}

// Other layouts than the paper's: a mirrored L of unequal squares, and three on a ray.
TEST(LabellingOf, ReadsTheOrderOffTheLayout) {
  TestRng rng;
  SquaresLayout layout;
  layout.squares = {{"A", {-0.4, 0.3}, 0.1},   {"B", {-0.1, 0.3}, 0.1}, {"C", {0.2, 0.3}, 0.1},
                    {"D", {0.2, 0.0}, 0.1},    {"E", {0.2, -0.2}, 0.1}, {"F", {0.2, -0.4}, 0.1},
                    {"G", {-0.35, -0.35}, 0.2}};
  const auto labelling = Labelling::of(layout);
  ASSERT_TRUE(labelling);
  std::vector<SeenSquare> labelled;
  for (int i = 0; i < 500; ++i) {
    const Rigid3 pose = looking_pose(rng.uniform(2, 6), rng.uniform(0, 60) * kRadFromDeg,
                                     rng.uniform(0, 2 * M_PI), rng.uniform(0, 2 * M_PI));
    const auto truth = squares_of(layout, camera(), pose);
    ASSERT_TRUE(labelling->label(shuffled(truth, rng), labelled)) << i;
    ASSERT_TRUE(same(labelled, truth)) << i;
  }
}

}  // namespace
}  // namespace perch
