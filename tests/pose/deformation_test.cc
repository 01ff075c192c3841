// Frames are made from a homography with known noise and deformation, as a detector would measure them.

#include "perch/pose/deformation.h"

#include <gtest/gtest.h>

#include "perch/pose/pose_estimator.h"
#include "support/near_pose.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr double kSigma = 0.02;  // of a piece of an edge, px
constexpr int kPieces = 60;

Eigen::Matrix3d homography_of(const Rigid3& pose) {
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  Eigen::Matrix3d H;
  H << R.col(0), R.col(1), pose.translation;
  return H;
}

// N(0, 1) for each number of the step, coloured by the covariance.
PlaneStep random_step(TestRng& rng, const PlaneInformation& covariance) {
  PlaneStep white;
  for (double& w : white) w = rng.normal();
  return covariance.llt().matrixL() * white;
}

// Pieces of edges anywhere on the target, in any direction, with their noise; all deformed alike by `px`.
PlaneMeasurement measure(TestRng& rng, const CameraModel& camera, const Rigid3& pose, double px) {
  PlaneMeasurement plane;
  const Eigen::Matrix3d H = homography_of(pose);
  plane.frame = {H.col(2).hnormalized(), 0.5 / pose.translation.z()};
  for (int i = 0; i < kPieces; ++i) {
    const Eigen::Vector2d u(rng.uniform(-1, 1), rng.uniform(-1, 1));
    const double direction = rng.uniform(0, 6.3);
    const PlaneStep row = step_jacobian(
        plane.frame.centre + plane.frame.radius * u,
        camera.intrinsics()[0] * Eigen::Vector2d(std::cos(direction), std::sin(direction)), plane.frame);
    plane.information += row * row.transpose() / (kSigma * kSigma);
  }
  const double per_px = step_per_px(plane, camera);
  const PlaneInformation covariance =
      plane.information.inverse() + std::pow(px * per_px, 2) * PlaneInformation::Identity();
  plane.image_from_plane = corrected(H, plane.frame, random_step(rng, covariance));
  plane.edges = kPieces;
  plane.sigma_px = kSigma;
  return plane;
}

// What the estimator makes of a flight of 400 frames, 2 to 5 m away.
struct Flight {
  double nees = 0, deformation_px2 = 0;
};

Flight fly(double px, bool remember) {
  const CameraModel camera = wide_camera();
  PoseEstimator estimator(sharp_target(), camera, {});
  TestRng rng;
  Flight flight;
  Deformation usual;
  constexpr int kFrames = 400, kSettled = 50;
  for (int i = 0; i < kFrames; ++i) {
    const Rigid3 pose = random_view(rng, rng.uniform(2, 5), 0.4);
    const NormalHint level{pose.rotation * Eigen::Vector3d::UnitZ(), 0.05};
    const PoseResult result = estimator.estimate(measure(rng, camera, pose, px), std::span(&level, 1), usual);
    EXPECT_EQ(result.status, PoseStatus::kOk);
    if (remember) usual = result.deformation;
    if (i < kSettled) continue;
    const auto& [mean, covariance] = result.camera_from_target;
    flight.nees += normalised_error_squared(pose_error(mean, pose), covariance) / (kFrames - kSettled);
    flight.deformation_px2 += usual.px2() / (kFrames - kSettled);
  }
  return flight;
}

// The mean of 350 chi-squares of six degrees is within 0.55 of six (three sigma); half as much again for what
// is not linear and for the deformation's own error.
TEST(Deformation, AFlightWithoutAnyIsHonest) {
  const Flight flight = fly(0, true);
  EXPECT_NEAR(flight.nees, 6, 0.8);
  EXPECT_LT(flight.deformation_px2, 0.01 * 0.01);
}

TEST(Deformation, IsLearntFromAFlightAndKeepsItHonest) {
  const Flight flight = fly(0.05, true);
  EXPECT_NEAR(flight.deformation_px2, 0.05 * 0.05, 0.3 * 0.05 * 0.05);
  EXPECT_GT(flight.nees, 4.5);  // it is known to a third at any time
  EXPECT_LT(flight.nees, 8);
  // Unheeded it would have been far from honest: the test would see it.
  EXPECT_GT(fly(0.05, false).nees, 12);
}

TEST(Deformation, LeavesNoMoreThanItAllows) {
  TestRng rng;
  const CameraModel camera = wide_camera();
  const PlaneMeasurement plane = measure(rng, camera, random_view(rng, 3, 0.4), 0);
  const double per_px = step_per_px(plane, camera);
  EXPECT_EQ(deformed(plane.information, 0, per_px), plane.information);
  const PlaneInformation left = deformed(plane.information, 0.1 * 0.1, per_px);
  const PlaneInformation covariance =
      plane.information.inverse() + std::pow(0.1 * per_px, 2) * PlaneInformation::Identity();
  EXPECT_THAT((left * covariance).eval(), IsNearMatrix(PlaneInformation::Identity(), 1e-8));
  // Nothing known stays nothing known.
  EXPECT_TRUE(deformed(PlaneInformation::Zero(), 1, per_px).isZero(0));
}

TEST(Deformation, OneWildFrameIsForgotten) {
  Deformation usual;
  usual.add(25, 1e3, 0);  // 5 px by a bad fit
  for (int i = 0; i < 100; ++i) usual.add(0, 1e6, 0);
  EXPECT_LT(usual.px2(), 0.01 * 0.01);
}

}  // namespace
}  // namespace perch
