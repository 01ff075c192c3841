#include "bound.h"

#include <gtest/gtest.h>

#include "perch/geometry/euler.h"
#include "support/drawing.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

// The picture of ALGORITHMS.md's "What is possible": blur 0.7 px, 120 grey levels from black to white, noise
// of 2 grey levels everywhere, no fall of light, a ground as dark as the paint.
const SensorOptions kSensor{.exposure = 120.0 / 255 / 0.7, .full_well = 1e7, .read_noise = 2.0 / 255 * 1e7};

SceneOptions even_scene() {
  SceneOptions scene = without_texture({});
  scene.white = 0.8;
  scene.black = 0.1;
  scene.ground.reflectance = 0.1;
  return scene;
}

PoseCovariance bound(const LandingTarget& target, const Rigid3& camera_from_target, double step_px = 0.1,
                     const SceneOptions& scene = even_scene()) {
  // Wide enough for the whole target from 2 m on.
  const CameraModel camera = CameraModel::pinhole(600, 600, 199.5, 199.5, 400, 400);
  return pose_bound(Renderer(camera, target, scene, {0.7, 0}), kSensor, 1, camera_from_target, step_px);
}

// Of the position across and along the view, and of a tilt.
struct Deviations {
  double x_mm, z_mm, tilt_deg;
};

Deviations deviations(const PoseCovariance& covariance) {
  const PoseError sigma = covariance.diagonal().cwiseSqrt();
  return {1e3 * sigma(0), 1e3 * sigma(2), sigma(3) / kRadFromDeg};
}

// A number as the table gives it: rounded to this digit.
struct Rounded {
  double value, digit;
};

// The table was made by other code and rounds to one or two digits. `share`: how far the two may be apart
// besides. Head-on, yaw 0.3: edges along the pixels' rows would depend on where in a pixel they are.
void expect_table(const LandingTarget& target, double range, double share, const Rounded& x_mm,
                  const Rounded& z_mm, const Rounded& tilt_deg) {
  const Deviations d = deviations(bound(target, looking_pose(range, 0, 0, 0.3, {0.0013, 0.0027})));
  const auto expect = [&](double ours, const Rounded& table, const char* what) {
    EXPECT_NEAR(ours, table.value, share * table.value + table.digit / 2) << what << " at " << range << " m";
  };
  expect(d.x_mm, x_mm, "x");
  expect(d.z_mm, z_mm, "z");
  expect(d.tilt_deg, tilt_deg, "tilt");
}

TEST(PoseBound, IsThatOfTheTableForTheWholeTarget) {
  expect_table(sharp_target(), 2, 0.1, {0.003, 0.001}, {0.01, 0.01}, {0.002, 0.001});
  expect_table(sharp_target(), 5, 0.1, {0.01, 0.01}, {0.08, 0.01}, {0.02, 0.01});
  expect_table(sharp_target(), 8, 0.1, {0.03, 0.01}, {0.27, 0.01}, {0.06, 0.01});
  expect_table(sharp_target(), 12, 0.1, {0.05, 0.01}, {0.74, 0.01}, {0.17, 0.01});
  expect_table(sharp_target(), 20, 0.1, {0.11, 0.01}, {2.7, 0.1}, {0.60, 0.01});
}

TEST(PoseBound, IsThatOfTheTableForTheSquaresAlone) {
  LandingTarget squares = sharp_target();
  squares.patches.erase(squares.patches.begin(), squares.patches.begin() + 2);  // the border and its inside
  expect_table(squares, 5, 0.1, {0.02, 0.01}, {0.32, 0.01}, {0.12, 0.01});
  // The table adds up edges one by one. From here on those of a small square, 5 px apart and then 3, share
  // pixels, and the picture tells less than the edges would.
  expect_table(squares, 12, 0.15, {0.08, 0.01}, {2.8, 0.1}, {1.04, 0.01});
  expect_table(squares, 20, 0.25, {0.17, 0.01}, {10, 1}, {3.7, 0.1});
}

TEST(PoseBound, DoesNotDependOnTheStep) {
  for (const double range : {2.5, 10.0}) {
    const Rigid3 pose = looking_pose(range, 0.4, 1, 0.4, {0.02, -0.01});
    const PoseError fine = bound(sharp_target(), pose, 0.05).diagonal().cwiseSqrt();
    const PoseError middle = bound(sharp_target(), pose, 0.1).diagonal().cwiseSqrt();
    const PoseError coarse = bound(sharp_target(), pose, 0.2).diagonal().cwiseSqrt();
    for (int i = 0; i < 6; ++i) {
      // The error grows with the step's square: 0.3 % at 0.1 px becomes 1.2 % at 0.2 px.
      EXPECT_NEAR(fine(i), middle(i), 0.005 * middle(i)) << range << " " << i;
      EXPECT_NEAR(coarse(i), middle(i), 0.015 * middle(i)) << range << " " << i;
    }
  }
}

TEST(PoseBound, KnowsNothingOfTheGroundsTexture) {
  // Ground alone: a texture moves with the pose and would tell all of it; an even one tells nothing.
  SceneOptions textured = even_scene();
  textured.ground.contrast = 0.25;
  const Rigid3 pose = looking_pose(3, 0.4, 1, 0.4);
  EXPECT_LT(bound(LandingTarget{}, pose, 0.1, textured)(2, 2), 1);
  const PoseCovariance even = bound(LandingTarget{}, pose);
  EXPECT_FALSE(even(2, 2) < 1e6) << even(2, 2);
}

}  // namespace
}  // namespace perch
