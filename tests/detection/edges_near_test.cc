// Targets that are larger than the picture, or hold a smaller one that is still far away.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "perch/detection/edges_detector.h"
#include "support/drawing.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

// Each polygon is drawn larger by half of a fine pixel, an eighth, on every side, black ones, too.
constexpr double kCornerPx = 0.3;

const CameraModel& camera() {
  static const CameraModel camera = CameraModel::pinhole(400, 400, 239.5, 239.5, 480, 480);
  return camera;
}

bool is_seen(const Rigid3& pose, const Eigen::Vector2d& point) {
  const Eigen::Vector2d p = seen_at(camera(), pose, point);
  return p.x() > 4 && p.y() > 4 && p.x() < camera().width() - 5 && p.y() < camera().height() - 5;
}

// Sides of the border's inner edge, 0.35 m from the middle, of which anything is in the picture.
int sides_seen(const Rigid3& pose) {
  int sides = 0;
  for (const double turn : {0.0, 0.5 * M_PI, M_PI, 1.5 * M_PI}) {
    bool any = false;
    for (double along = -0.35; along <= 0.35; along += 0.01)
      any = any || is_seen(pose, Eigen::Rotation2Dd(turn) * Eigen::Vector2d(0.35, along));
    sides += any;
  }
  return sides;
}

// The camera hangs over the squares so low that of the border one side or none is left in the picture.
TEST(EdgesNear, AllSquaresAreATargetWithoutItsBorder) {
  const LandingTarget target = sharp_target();
  EdgesDetector detector(target, camera(), {});
  int asked = 0, without = 0;
  for (unsigned i = 0; i < 400; ++i) {
    TestRng rng(i);
    const double yaw = rng.index(4) * M_PI / 2 + rng.uniform(-0.15, 0.15);
    const Rigid3 pose = looking_pose(rng.uniform(0.43, 0.6), rng.uniform(0, 0.15), rng.uniform(0, 6.3), yaw,
                                     {rng.uniform(-0.06, 0.06), rng.uniform(-0.06, 0.06)});
    const bool squares = std::ranges::all_of(
        target.features, [&](const Feature& feature) { return is_seen(pose, feature.point); });
    const int sides = sides_seen(pose);
    if (!squares || sides > 1) continue;
    ++asked;
    without += sides == 0;
    Drawing drawing;
    drawing.blur_px = rng.uniform(0.5, 1.2);
    drawing.noise = rng.uniform(0, 4);
    const auto& found = detector.detect(picture_of(target, camera(), pose, drawing, &rng), {});
    ASSERT_EQ(found.status, DetectionStatus::kFound) << i << ", " << sides << " sides";
    EXPECT_LT(worst_corner_px(found, target, camera(), pose), kCornerPx) << i;
  }
  EXPECT_GE(asked, 20);
  EXPECT_GE(without, 5);
}

// What is left of a square at the picture's edge has another centre and other corners than the square.
TEST(EdgesNear, CutSquaresLeadNowhere) {
  const LandingTarget target = sharp_target();
  EdgesDetector detector(target, camera(), {});
  int asked = 0, found = 0;
  for (unsigned i = 0; i < 300; ++i) {
    TestRng rng(i);
    const Rigid3 pose = looking_pose(rng.uniform(0.4, 0.9), rng.uniform(0, 0.5), rng.uniform(0, 6.3),
                                     rng.uniform(0, 6.3), {rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)});
    int whole = 0, cut = 0;
    for (size_t square = 0; square < 6; ++square) {
      const auto corners = std::span(target.features).subspan(4 * square, 4);
      const auto seen = std::ranges::count_if(
          corners, [&](const Feature& feature) { return is_seen(pose, feature.point); });
      whole += seen == 4;
      cut += seen > 0 && seen < 4;
    }
    if (whole < 4 || cut == 0 || sides_seen(pose) < 2) continue;
    ++asked;
    const auto& detection = detector.detect(picture_of(target, camera(), pose), {});
    if (detection.status != DetectionStatus::kFound) continue;
    ++found;
    for (const Correspondence& c : detection.correspondences) {
      const Eigen::Vector2d& point = target.features[static_cast<size_t>(c.feature)].point;
      EXPECT_LT((c.pixel - seen_at(camera(), pose, point)).norm(), kCornerPx) << i;
    }
  }
  EXPECT_GE(asked, 20);
  EXPECT_GE(found, 0.97 * asked);
}

// The inner target's squares have 2 to 5 px, the outer one's far more: they are measured by their edges, in
// a thousandth of the time that a fit of the whole picture takes.
TEST(EdgesNear, ANestedTargetIsMeasuredByItsEdges) {
  const LandingTarget target = nested_target();
  EdgesDetector detector(target, camera(), {});
  for (unsigned i = 0; i < 20; ++i) {
    TestRng rng(i);
    const Rigid3 pose =
        looking_pose(rng.uniform(1, 2.5), rng.uniform(0, 0.4), rng.uniform(0, 6.3), rng.uniform(0, 6.3));
    const auto& found = detector.detect(picture_of(target, camera(), pose), {});
    ASSERT_EQ(found.status, DetectionStatus::kFound) << i;
    // One for each piece of an edge; a picture has thousands of pixels, and no residuals of edges.
    EXPECT_EQ(found.residuals.size(), static_cast<size_t>(found.plane->edges)) << i;
    EXPECT_LT(found.plane->edges, 400) << i;
    EXPECT_LT(worst_corner_px(found, target, camera(), pose), kCornerPx) << i;
  }
}

}  // namespace
}  // namespace perch
