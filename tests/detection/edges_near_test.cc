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

// From where the inner target fills the picture, the outer one of the same look is eight times as far away:
// the hole around the inner one is all that tells which it is.
TEST(EdgesNear, TheInnerTargetIsNotTakenForTheOuterOne) {
  const LandingTarget target = nested_target();
  EdgesDetector detector(target, camera(), {});
  const Nested& nested = *std::get<SquaresLayout>(target.layout).nested;
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(1e-4), Eigen::Vector3d::Constant(1e-4);
  int found = 0;
  for (unsigned i = 0; i < 100; ++i) {
    TestRng rng(i);
    const double height = rng.uniform(0.25, 0.55);
    Rigid3 pose = looking_pose(height, rng.uniform(0, 0.2), rng.uniform(0, 6.3), rng.uniform(0, 6.3),
                               {rng.uniform(-0.2, 0.2) * height, rng.uniform(-0.2, 0.2) * height});
    // The inner target as it lies in the picture, and the outer one that would look the same.
    const Rigid3 inner = pose;
    pose.translation -= pose.rotation * Eigen::Vector3d(nested.centre.x(), nested.centre.y(), 0);
    const Rigid3 outer{inner.rotation, inner.translation * target.size / nested.size};
    const cv::Mat grey = picture_of(target, camera(), pose);
    for (const bool is_predicted : {false, true}) {
      const Prediction prediction{{outer, covariance}, 0.6};
      const auto& detection = detector.detect(grey, is_predicted ? std::optional(prediction) : std::nullopt);
      if (detection.status != DetectionStatus::kFound) continue;
      ++found;
      for (const Correspondence& c : detection.correspondences) {
        const Eigen::Vector2d& point = target.features[static_cast<size_t>(c.feature)].point;
        EXPECT_LT((c.pixel - seen_at(camera(), pose, point)).norm(), 1) << i << is_predicted;
      }
    }
  }
  EXPECT_GE(found, 100);
}

// The inner target's squares have 2 to 5 px, the outer one's far more: they are measured by their edges, in
// a twelfth of the time that a fit of the whole picture takes.
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
