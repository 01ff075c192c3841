#include "perch/pose/planar_ambiguity.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "perch/pose/pose_estimator.h"
#include "support/near_pose.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

TEST(MirroredPose, MirroredTwiceIsItself) {
  TestRng rng;
  for (int i = 0; i < 1000; ++i) {
    const Rigid3 pose = random_view(rng, rng.uniform(0.5, 50), rng.uniform(0, 1.5));
    EXPECT_THAT(mirrored_pose(mirrored_pose(pose)), IsNearPose(pose, 16 * kEpsilon, 0.0));
  }
}

TEST(MirroredPose, IsItselfWhenSeenStraightOn) {
  const Rigid3 pose = view(5, Eigen::Vector3d(0.1, -0.2, 1).normalized(), 0, 0, 1);
  EXPECT_THAT(mirrored_pose(pose), IsNearPose(pose, 16 * kEpsilon, 0.0));
}

TEST(MirroredPose, TurnsTheNormalOverToTheOtherSideOfTheLineOfSight) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const double tilt = rng.uniform(0, 1.5);
    const Rigid3 pose = random_view(rng, 3, tilt), mirrored = mirrored_pose(pose);
    const Eigen::Vector3d back = -pose.translation.normalized();
    const Eigen::Vector3d normal = pose.rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d other = mirrored.rotation * Eigen::Vector3d::UnitZ();
    // Both tilted by as much, one to each side: their mean is along the line of sight.
    EXPECT_THAT((normal + other).eval(), IsNearMatrix((2 * std::cos(tilt) * back).eval(), 16 * kEpsilon));
  }
}

// Weak perspective is orthographic projection along the line of sight. Points move along it alone.
TEST(MirroredPose, KeepsTheWeakPerspectivePicture) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const Rigid3 pose = random_view(rng, 5, rng.uniform(0, 1.5)), mirrored = mirrored_pose(pose);
    const Eigen::Vector3d v = pose.translation.normalized();
    for (const auto& feature : sharp_target().features) {
      const Eigen::Vector3d q(feature.point.x(), feature.point.y(), 0);
      const Eigen::Vector3d apart = mirrored * q - pose * q;
      EXPECT_LE((apart - v * v.dot(apart)).norm(), 16 * kEpsilon * 5);
    }
  }
}

TEST(InfinitesimalPoses, OneIsTheTruthAndTheOtherItsMirrorImage) {
  TestRng rng;
  for (int i = 0; i < 500; ++i) {
    const Rigid3 truth = random_view(rng, rng.uniform(0.5, 30), rng.uniform(0, 75 * kRadFromDeg));
    // H about a centre, of any scale and sign.
    const Eigen::Vector2d centre(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2));
    const Rigid3 of_centre{truth.rotation, truth * Eigen::Vector3d(centre.x(), centre.y(), 0)};
    PlaneView seen_as{of_centre.rotation.toRotationMatrix(), centre};
    seen_as.H.col(2) = of_centre.translation;
    seen_as.H *= rng.uniform(-5, 5);
    const auto poses = infinitesimal_poses(seen_as);
    ASSERT_TRUE(poses);
    const auto off = [&](const Rigid3& pose) { return pose.rotation.angularDistance(truth.rotation); };
    const auto& [nearer, other] = off((*poses)[0]) < off((*poses)[1]) ? std::pair((*poses)[0], (*poses)[1])
                                                                      : std::pair((*poses)[1], (*poses)[0]);
    // The tilt comes out as a root of 1 - cos^2: seen straight on rounding becomes its root.
    const double rounding = 4 * std::sqrt(kEpsilon);
    EXPECT_THAT(nearer, IsNearPose(truth, rounding, rounding));
    const Rigid3 mirrored = mirrored_pose(of_centre);
    EXPECT_LE(other.rotation.angularDistance(mirrored.rotation), 2 * rounding);
    EXPECT_LE((other * Eigen::Vector3d(centre.x(), centre.y(), 0) - mirrored.translation).norm(), rounding);
  }
}

TEST(InfinitesimalPoses, IsEmptyForAMirroredOrAnEdgeOnView) {
  TestRng rng;
  const Rigid3 truth = random_view(rng, 3, 0.5);
  PlaneView seen_as{truth.rotation.toRotationMatrix(), Eigen::Vector2d::Zero()};
  seen_as.H.col(2) = truth.translation;
  EXPECT_TRUE(infinitesimal_poses(seen_as));
  const Eigen::DiagonalMatrix<double, 3> mirror(-1, 1, 1);
  EXPECT_FALSE(infinitesimal_poses({mirror * seen_as.H, seen_as.centre}));
  EXPECT_FALSE(infinitesimal_poses({Eigen::Matrix3d::Constant(std::nan("")), seen_as.centre}));
  EXPECT_FALSE(infinitesimal_poses({Eigen::Matrix3d::Ones(), seen_as.centre}));
  EXPECT_FALSE(infinitesimal_poses({Eigen::Matrix3d::Zero(), seen_as.centre}));
}

// All minima of the reprojection error, by starts from everywhere, the lowest first.
struct Found {
  Rigid3 camera_from_target;
  double cost = 0;
};
std::vector<Found> search(const CameraModel& camera, const std::vector<Correspondence>& correspondences,
                          const Rigid3& near) {
  const LandingTarget target = sharp_target();
  std::vector<Observation> observations;
  for (const auto& c : correspondences) {
    const auto& q = target.features[static_cast<size_t>(c.feature)].point;
    observations.push_back({{q.x(), q.y(), 0}, c.pixel, c.sigma_px});
  }
  ReprojectionErrors errors(camera);
  errors.observe(observations);
  PoseSolver solver;
  solver.options.max_num_iterations = 200;
  solver.options.function_tolerance = 1e-12;
  std::vector<Found> minima;
  const Eigen::Vector3d towards = near.translation.normalized();
  for (double tilt = 10; tilt < 85; tilt += 20) {
    for (double about = 0; about < 360; about += 45) {
      // The face's direction in the picture is known to any eye: that of the pose nearby.
      const Rigid3 facing =
          view(near.translation.norm(), towards, tilt * kRadFromDeg, about * kRadFromDeg, 0);
      const Eigen::Matrix3d turn =
          facing.rotation.conjugate().toRotationMatrix() * near.rotation.toRotationMatrix();
      const double yaw = std::atan2(turn(1, 0), turn(0, 0));
      const Rigid3 start{facing.rotation * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()),
                         near.translation};
      const ReprojectionCost cost(errors, start, PoseOptions{}.huber_sigmas);
      PoseVector x = PoseVector::Zero();
      solver.Solve(cost, &x);
      const Found found{cost.pose(x), 2 * solver.summary.final_cost};
      const Eigen::Vector3d normal = found.camera_from_target.rotation * Eigen::Vector3d::UnitZ();
      const bool known = std::ranges::any_of(minima, [&](const Found& f) {
        return f.camera_from_target.rotation.angularDistance(found.camera_from_target.rotation) < 0.01;
      });
      if (!known && normal.dot(towards) < 0) minima.push_back(found);
    }
  }
  std::ranges::sort(minima, {}, &Found::cost);
  return minima;
}

TEST(PlanarAmbiguity, BothMinimaAreWhereASearchOfEverythingFindsThem) {
  const CameraModel camera = wide_camera();
  const LandingTarget target = sharp_target();
  PoseEstimator estimator(target, camera, PoseOptions{});
  TestRng rng;
  int two = 0;
  for (int i = 0; i < 100; ++i) {
    const Rigid3 truth = random_view(rng, rng.uniform(4, 15), rng.uniform(15, 50) * kRadFromDeg);
    const auto correspondences = seen(target, camera, truth, rng, 0.2, 0.2);
    const PoseResult result = estimator.estimate(correspondences);
    ASSERT_TRUE(result.status == PoseStatus::kOk || result.status == PoseStatus::kAmbiguous);
    const auto minima = search(camera, correspondences, truth);
    // The product's descent ends when the cost falls by less than 1e-5 of a squared sigma: 3e-3 of a
    // deviation, which is up to 0.3 rad and m.
    EXPECT_THAT(result.camera_from_target.mean, IsNearPose(minima.at(0).camera_from_target, 1e-3, 1e-3)) << i;
    // One that fits too badly to be in question is not looked for further.
    if (minima.size() < 2 || minima[1].cost > 100) continue;
    ++two;
    ASSERT_TRUE(result.second) << i;
    EXPECT_THAT(result.second->mean, IsNearPose(minima[1].camera_from_target, 1e-3, 1e-3)) << i;
    EXPECT_NEAR(result.ambiguity, minima[0].cost / minima[1].cost, 1e-4) << i;
  }
  EXPECT_GT(two, 50);
}

TEST(PlanarAmbiguity, IsBetweenNoDoubtAndUndecidable) {
  const CameraModel camera = wide_camera();
  const LandingTarget target = sharp_target();
  PoseEstimator estimator(target, camera, PoseOptions{});
  TestRng rng;
  for (int i = 0; i < 500; ++i) {
    const Rigid3 truth = random_view(rng, rng.uniform(1.7, 30), rng.uniform(0, 1.2));
    const double noise = i % 5 == 0 ? 0 : rng.uniform(0.1, 0.5);
    const PoseResult result = estimator.estimate(seen(target, camera, truth, rng, noise, 0.3));
    EXPECT_GE(result.ambiguity, 0);
    EXPECT_LE(result.ambiguity, 1);
  }
}

}  // namespace
}  // namespace perch
