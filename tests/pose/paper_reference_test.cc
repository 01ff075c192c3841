#include "pose/paper_reference.h"

#include "pose/ceres_reference.h"
#include "support/differentiate.h"
#include "support/near_pose.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

// The reference is only worth something when it is itself the paper's.
namespace perch {
namespace {

struct World {
  Rigid3 truth;
  PlaneAndImage points;
};

World random_world(TestRng& rng, double noise) {
  const Rigid3 truth = random_view(rng, rng.uniform(1, 6), rng.uniform(10, 60) * kRadFromDeg);
  return {truth, ideal_view(sharp_target(), truth, rng, noise)};
}

TEST(PaperReference, TheTrueHomographyIsTheNullVectorOfF) {
  TestRng rng;
  for (int i = 0; i < 50; ++i) {
    const auto [truth, points] = random_world(rng, 0);
    const Eigen::Matrix3d R = truth.rotation.toRotationMatrix();
    Eigen::Matrix<double, 9, 1> v;
    v << R.col(0), R.col(1), truth.translation;
    const Eigen::VectorXd zero = paper_F(points.plane, points.image) * v;
    EXPECT_LE(zero.cwiseAbs().maxCoeff(), 32 * kEpsilon * 6);  // numbers of up to 6 m
  }
}

TEST(PaperReference, DGIsTheDerivativeOfG) {
  TestRng rng;
  for (int i = 0; i < 20; ++i) {
    const auto [truth, points] = random_world(rng, 1e-3);
    const Beta beta = beta_from_pose(truth) + random_error(rng, 0.05, 0.05);
    // Of 48 errors the first eight: numeric_jacobian takes vectors of a fixed size.
    const auto G8 = [&](const Beta& b) -> Eigen::Matrix<double, 8, 1> {
      return paper_G(points.plane, points.image, b).head<8>();
    };
    // Central differences: step^2 and epsilon / step of numbers of up to 6 m.
    EXPECT_THAT(paper_DG(points.plane, points.image, beta).topRows<8>(),
                IsNearMatrix(numeric_jacobian(G8, beta, 1e-5), 1e-9));
  }
}

TEST(PaperReference, NewtonRaphsonFindsTheTruthOnExactData) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const auto [truth, points] = random_world(rng, 0);
    const Rigid3 start = perturb(truth, random_error(rng, 0.03, 0.03));
    const auto found = paper_newton_raphson(points.plane, points.image, start);
    // Rounding of G, epsilon of 6 m, against the weakest direction of DG, (size / range)^2 = 1/36.
    EXPECT_THAT(pose_from_beta(found.beta), IsNearPose(truth, 1e4 * kEpsilon, 1e4 * kEpsilon));
  }
}

TEST(PaperReference, EachStepLowersTheErrorFromAnyStart) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const auto [truth, points] = random_world(rng, 1e-3);
    const Beta beta = beta_from_pose({rng.rotation(), truth.translation + rng.normal3(1)});
    PaperIteration at{beta, paper_G(points.plane, points.image, beta).norm()};
    for (int n = 0; n < 50; ++n) {
      const auto next = paper_step(points.plane, points.image, at);
      if (!next) break;
      ASSERT_LT(next->norm_G, at.norm_G);
      at = *next;
    }
  }
}

// Equation 2.9: gamma = (pi + theta_1, pi - theta_2, pi + theta_3, p) is the same pose, and its steps are the
// same poses.
TEST(PaperReference, BothEulerParameterisationsStepThroughTheSamePoses) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const auto [truth, points] = random_world(rng, 1e-3);
    const Beta delta = beta_from_pose(perturb(truth, random_error(rng, 0.05, 0.05)));
    Beta gamma = delta;
    gamma.head<3>() << M_PI + delta(0), M_PI - delta(1), M_PI + delta(2);
    Beta signs;
    signs << 1, -1, 1, 1, 1, 1;
    // Numbers of up to 6 m times a few products of rotations.
    const double rounding = 64 * kEpsilon * 6;
    EXPECT_THAT(
        paper_DG(points.plane, points.image, delta),
        IsNearMatrix((paper_DG(points.plane, points.image, gamma) * signs.asDiagonal()).eval(), rounding));

    PaperIteration at_delta{delta, paper_G(points.plane, points.image, delta).norm()};
    PaperIteration at_gamma{gamma, at_delta.norm_G};
    for (int n = 0; n < 3; ++n) {
      const auto next_delta = paper_step(points.plane, points.image, at_delta);
      const auto next_gamma = paper_step(points.plane, points.image, at_gamma);
      ASSERT_TRUE(next_delta && next_gamma);
      at_delta = *next_delta, at_gamma = *next_gamma;
      // Rounding, grown by the condition of DG: Euler angles near pitch = 90 degrees and (size / range)^2.
      EXPECT_THAT(pose_from_beta(at_gamma.beta),
                  IsNearPose(pose_from_beta(at_delta.beta), 1e6 * kEpsilon, 1e6 * kEpsilon));
    }
  }
}

// On the paper's own cost its iteration and Ceres find the same minimum.
TEST(PaperReference, NewtonRaphsonAgreesWithCeres) {
  TestRng rng;
  for (int i = 0; i < 50; ++i) {
    constexpr double kNoise = 0.3 / 600;
    const auto [truth, points] = random_world(rng, kNoise);
    const Rigid3 start = paper_linear(points.plane, points.image);
    const auto papers = paper_newton_raphson(points.plane, points.image, start);
    CeresReference reference;
    reference.add(PaperErrors{points.plane, points.image}, points.plane.size());
    const Rigid3 ceres = reference.solve(start);
    EXPECT_NEAR(papers.norm_G * papers.norm_G, reference.cost(), 1e-12 * reference.cost());
    // Both end where the cost can no longer tell, sqrt(epsilon) of it: that part of the estimate's own
    // deviation, which is below 0.1 m or rad here; the factor is for the root of 42 degrees of freedom.
    const double tolerance = 0.1 * 10 * std::sqrt(kEpsilon);
    EXPECT_THAT(pose_from_beta(papers.beta), IsNearPose(ceres, tolerance, tolerance));
  }
}

}  // namespace
}  // namespace perch
