#include "perch/pose/reprojection.h"

#include <ceres/jet.h>

#include <limits>

#include "perch/pose/linear_seed.h"
#include "pose/ceres_reference.h"
#include "pose/paper_reference.h"
#include "support/differentiate.h"
#include "support/near_pose.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr double kNoHuber = 1e9;
constexpr double kHuber = 2;

std::vector<Observation> observations_of(const CameraModel& camera, const Rigid3& truth, TestRng& rng,
                                         double noise_px) {
  const LandingTarget target = sharp_target();
  std::vector<Observation> observations;
  for (const auto& c : seen(target, camera, truth, rng, noise_px, 0.3)) {
    const auto& q = target.features[static_cast<size_t>(c.feature)].point;
    observations.push_back({{q.x(), q.y(), 0}, c.pixel, c.sigma_px});
  }
  return observations;
}

using Jet = ceres::Jet<double, 6>;

// The product's sum again in numbers that know their derivative: Exp by Rodrigues' formula, OpenCV's lens.
// The gradient is that of the loss; for the curvature each error is replaced by its linear model about x, and
// the loss of that differentiated by its closed form.
LossSum sum_by_jets(const CameraModel& camera, const std::vector<Observation>& observations,
                    const Rigid3& base, double huber, const PoseVector& x) {
  using Vector3 = Eigen::Matrix<Jet, 3, 1>;
  Vector3 d, r;
  for (int i = 0; i < 3; ++i) d(i) = Jet(x(i), i), r(i) = Jet(x(3 + i), 3 + i);
  LossSum sum;
  for (const auto& o : observations) {
    const Vector3 v = (base.rotation * o.p_target).cast<Jet>();
    const Jet angle = r.norm();
    const Vector3 axis = r / angle;
    const Vector3 turned =
        v * cos(angle) + axis.cross(v) * sin(angle) + axis * (axis.dot(v) * (1.0 - cos(angle)));
    const Vector3 p = turned + base.translation.cast<Jet>() + d;
    const Eigen::Matrix<Jet, 2, 1> error =
        (opencv5_pixel<Jet>(camera.intrinsics(), p) - o.pixel.cast<Jet>()) / Jet(o.sigma_px);
    const Jet distance = error.norm();
    const Jet loss = distance > huber ? 2.0 * huber * distance - huber * huber : Jet(error.squaredNorm());
    sum.value += loss.a;
    sum.half_gradient += loss.v / 2;
    Eigen::Matrix<double, 2, 6> J;
    J << error(0).v.transpose(), error(1).v.transpose();
    const Eigen::Vector2d e(error(0).a, error(1).a);
    // The Hessian of 2 k |e| is 2 k / |e| (I - e e' / e'e).
    Eigen::Matrix2d by_error = Eigen::Matrix2d::Identity();
    if (distance > huber) by_error = huber / e.norm() * (by_error - e * e.transpose() / e.squaredNorm());
    sum.half_curvature += J.transpose() * by_error * J;
  }
  return sum;
}

TEST(WhitenedError, JacobianIsThatOfTheNumbers) {
  const CameraModel camera = wide_camera();
  TestRng rng;
  for (int i = 0; i < 50; ++i) {
    const Rigid3 pose = random_view(rng, rng.uniform(1.7, 10), rng.uniform(0, 1.2));
    for (const auto& o : observations_of(camera, pose, rng, 1)) {
      Eigen::Vector2d error;
      PixelJacobian analytic;
      ASSERT_TRUE(whitened_error(camera, pose, o, &error, &analytic));
      const auto at = [&](const PoseError& step) {
        Eigen::Vector2d e = Eigen::Vector2d::Zero();
        whitened_error(camera, perturb(pose, step), o, &e, nullptr);
        return e;
      };
      // Numbers of 2000 (640 px / 0.3), derivatives of up to 1000 a metre, a step of 1e-5: epsilon / step
      // and step^2 of them give 5e-8 and 1e-7; a factor of ten.
      const PoseError zero = PoseError::Zero();
      EXPECT_THAT(analytic, IsNearMatrix(numeric_jacobian(at, zero, 1e-5), 1e-6));
    }
  }
}

TEST(WhitenedError, IsFalseForAPointBehindTheCamera) {
  Eigen::Vector2d error;
  PixelJacobian jacobian;
  const Rigid3 behind{Eigen::Quaterniond::Identity(), {0, 0, -1}};
  EXPECT_FALSE(whitened_error(wide_camera(), behind, Observation{}, &error, nullptr));
  EXPECT_FALSE(whitened_error(wide_camera(), behind, Observation{}, &error, &jacobian));
}

struct SevenResiduals {
  Eigen::Matrix<double, 7, 1> f;
  Eigen::Matrix<double, 7, 6> J;
};

TEST(ReprojectionErrors, AreThoseOfThePoseAskedFor) {
  const CameraModel camera = wide_camera();
  TestRng rng;
  ReprojectionErrors errors(camera);
  Rigid3 pose = random_view(rng, 3, 0.3);
  EXPECT_TRUE(errors.at(pose).empty());
  for (int i = 0; i < 200; ++i) {
    const bool other_observations = rng.index(3) == 0 || i == 0;
    if (other_observations) errors.observe(observations_of(camera, random_view(rng, 3, 0.3), rng, 1));
    // The same pose, one that differs in its last number, one behind the camera, another.
    const int which = rng.index(4);
    if (which == 1) pose.rotation.w() *= 1 + 4 * kEpsilon;
    if (which == 2) {
      EXPECT_TRUE(errors.at({pose.rotation, -pose.translation}).empty());
    }
    if (which == 3) pose = random_view(rng, 3, 0.3);
    const auto found = errors.at(pose);
    ASSERT_EQ(found.size(), errors.observations().size());
    for (size_t k = 0; k < found.size(); ++k) {
      Eigen::Vector2d error;
      PixelJacobian jacobian;
      ASSERT_TRUE(whitened_error(camera, pose, errors.observations()[k], &error, &jacobian));
      EXPECT_EQ(found[k].error, error);
      EXPECT_EQ(found[k].jacobian, jacobian);
    }
  }
}

// Away from r = 0, where the left Jacobian counts, with Huber's bound beyond all errors and amid them.
TEST(ReprojectionCost, DerivativesAreThoseOfAutomaticDifferentiation) {
  const CameraModel camera = wide_camera();
  TestRng rng;
  int beyond = 0, within = 0;
  for (int i = 0; i < 100; ++i) {
    const Rigid3 truth = random_view(rng, rng.uniform(1.7, 10), rng.uniform(0, 1));
    const auto observations = observations_of(camera, truth, rng, 0.5);
    PoseVector x;
    x << rng.normal3(0.002), rng.normal3(i % 2 == 0 ? 0.5 : 1e-3);
    // A base from which x leads near the truth, so that errors on both sides of the bound are there.
    const Rigid3 base{so3_exp(x.tail<3>()).conjugate() * truth.rotation, truth.translation - x.head<3>()};
    for (const double huber : {kNoHuber, kHuber}) {
      ReprojectionErrors errors(camera);
      errors.observe(observations);
      const ReprojectionCost cost(errors, base, huber);
      const LossSum automatic = sum_by_jets(camera, observations, base, huber, x);
      LossSum analytic;
      ASSERT_TRUE(cost.sum(x, true, &analytic));
      // Pixels of 640 round to 640 epsilon / 0.3 of an error; errors are some 3, their derivatives up to
      // 600 / 1.7 / 0.3 = 1200 a metre, and 24 of them are summed. Ten for the roundings on the way.
      const double of_error = 10 * kEpsilon * 640 / 0.3, slope = 1200;
      EXPECT_NEAR(analytic.value, automatic.value, 24 * 2 * 3 * of_error);
      EXPECT_THAT(analytic.half_gradient, IsNearMatrix(automatic.half_gradient, 24 * slope * of_error));
      EXPECT_THAT(analytic.half_curvature,
                  IsNearMatrix(automatic.half_curvature, 24 * slope * slope * of_error));

      // Without derivatives the same value, and in seven residuals the same of all.
      LossSum value;
      ASSERT_TRUE(cost.sum(x, false, &value));
      EXPECT_EQ(value.value, analytic.value);
      SevenResiduals seven;
      ASSERT_TRUE(cost(x.data(), seven.f.data(), seven.J.data()));
      EXPECT_NEAR(seven.f.squaredNorm(), analytic.value, 16 * kEpsilon * analytic.value);
      const Eigen::Matrix<double, 6, 6> JtJ = seven.J.transpose() * seven.J;
      EXPECT_THAT((seven.J.transpose() * seven.f).eval(),
                  IsNearMatrix(analytic.half_gradient, 24 * slope * of_error));
      EXPECT_THAT(JtJ, IsNearMatrix(analytic.half_curvature, 24 * slope * slope * of_error));

      Eigen::Vector2d error;
      for (const auto& o : observations) {
        ASSERT_TRUE(whitened_error(camera, cost.pose(x), o, &error, nullptr));
        (error.norm() > kHuber ? beyond : within) += 1;
      }
    }
  }
  // Both branches have been seen.
  EXPECT_GT(beyond, 500);
  EXPECT_GT(within, 500);
}

// With all errors beyond the bound the curvature is so flat that its step would gain more than there is.
TEST(ReprojectionCost, KeepsTheValueAndTheGradientWhereTheCurvatureIsTooFlat) {
  const CameraModel camera = wide_camera();
  TestRng rng;
  int flat = 0;
  for (int i = 0; i < 100; ++i) {
    const Rigid3 truth = random_view(rng, 3, rng.uniform(0, 1));
    const auto observations = observations_of(camera, truth, rng, 0.3);
    ReprojectionErrors errors(camera);
    errors.observe(observations);
    const ReprojectionCost cost(errors, perturb(truth, random_error(rng, 0.1, 0.1)), kHuber);
    const PoseVector zero = PoseVector::Zero();
    LossSum sum;
    SevenResiduals seven;
    ASSERT_TRUE(cost.sum(zero, true, &sum));
    ASSERT_TRUE(cost(zero.data(), seven.f.data(), seven.J.data()));
    EXPECT_NEAR(seven.f.squaredNorm(), sum.value, 16 * kEpsilon * sum.value);
    // Of the largest numbers at hand, through six steps of elimination.
    const double size = sum.half_gradient.cwiseAbs().maxCoeff();
    EXPECT_THAT((seven.J.transpose() * seven.f).eval(),
                IsNearMatrix(sum.half_gradient, 1e3 * kEpsilon * size));
    flat += seven.J.squaredNorm() > (1 + 1e-6) * sum.half_curvature.trace();
  }
  EXPECT_GT(flat, 10);
}

TEST(HuberLoss, IsTheSquareThatGoesOnInAStraightLine) {
  EXPECT_EQ(huber_loss(0, 2), 0);
  EXPECT_EQ(huber_loss(1.5, 2), 2.25);
  EXPECT_EQ(huber_loss(2, 2), 4);
  EXPECT_EQ(huber_loss(3, 2), 8);  // slope 4
  EXPECT_EQ(huber_loss(3, std::numeric_limits<double>::infinity()), 9);
}

TEST(ReprojectionCost, PoseMovesAndTurnsByTheParameters) {
  TestRng rng;
  const Rigid3 base = rng.pose(5);
  ReprojectionErrors errors(wide_camera());
  const ReprojectionCost cost(errors, base, kHuber);
  PoseVector x;
  x << 0.1, 0.2, 0.3, 0.4, -0.5, 0.6;
  EXPECT_THAT(cost.pose(x), IsNearPose(perturb(base, x), 8 * kEpsilon, 0.0));
  EXPECT_EQ(cost.pose(PoseVector::Zero()).rotation.coeffs(), base.rotation.coeffs());
}

// An optimiser would learn to like a residual of zero.
TEST(ReprojectionCost, APointThatCannotBeProjectedIsHugeAndNeverNan) {
  const CameraModel camera = wide_camera();
  TestRng rng;
  const Rigid3 base = random_view(rng, 3, 0.3);
  const auto observations = observations_of(camera, base, rng, 0.3);
  ReprojectionErrors errors(camera);
  errors.observe(observations);
  const ReprojectionCost cost(errors, base, kHuber);
  PoseVector x = PoseVector::Zero();
  x.z() = -base.translation.z();  // the middle of the target in the camera
  SevenResiduals seven;
  EXPECT_FALSE(cost(x.data(), seven.f.data(), seven.J.data()));
  EXPECT_GT(seven.f.norm(), 1e5);
  EXPECT_TRUE(seven.f.allFinite());
  EXPECT_THAT(seven.J, IsNearMatrix(Eigen::Matrix<double, 7, 6>::Zero(), 0.0));
  EXPECT_FALSE(cost(x.data(), seven.f.data(), nullptr));
  EXPECT_GT(seven.f.norm(), 1e5);
}

class Refinement : public testing::Test {
 protected:
  Refinement() {
    // To the last digit.
    solver_.options.max_num_iterations = 100;
    solver_.options.function_tolerance = 0;
    solver_.options.gradient_tolerance = 0;
    solver_.options.cost_threshold = 0;
    solver_.options.parameter_tolerance = 1e-14;
  }
  Rigid3 refine(const std::vector<Observation>& observations, const Rigid3& start, double huber) {
    ReprojectionErrors errors(camera_);
    errors.observe(observations);
    const ReprojectionCost cost(errors, start, huber);
    PoseVector x = PoseVector::Zero();
    solver_.Solve(cost, &x);
    return cost.pose(x);
  }

  CameraModel camera_ = wide_camera();
  PoseSolver solver_;
  TestRng rng_;
  // Two solvers that both end where the cost can no longer tell, sqrt(epsilon) of it, differ by that part of
  // the estimate's deviation, which is below 0.1 m or rad here; ten for the root of 42 degrees of freedom.
  double tolerance_ = 0.1 * 10 * std::sqrt(kEpsilon);
};

TEST_F(Refinement, FindsTheTruthOnExactData) {
  for (int i = 0; i < 100; ++i) {
    const Rigid3 truth = random_view(rng_, rng_.uniform(1.7, 6), rng_.uniform(10, 60) * kRadFromDeg);
    const auto observations = observations_of(camera_, truth, rng_, 0);
    const Rigid3 start = perturb(truth, random_error(rng_, 0.02, 0.02));
    CeresReference reference;
    reference.add(PixelErrors{camera_.intrinsics(), observations}, observations.size());
    // The cost falls to zero here and tells everything: what is left is rounding of 640 px, some 1e-13 px,
    // over the weakest direction, some 10 px a rad.
    EXPECT_THAT(refine(observations, start, kNoHuber), IsNearPose(truth, 1e-11, 1e-11));
    EXPECT_THAT(reference.solve(start), IsNearPose(truth, 1e-11, 1e-11));
  }
}

TEST_F(Refinement, AgreesWithOneBlockOfCeresOnNoise) {
  for (int i = 0; i < 50; ++i) {
    const Rigid3 truth = random_view(rng_, rng_.uniform(1.7, 6), rng_.uniform(10, 60) * kRadFromDeg);
    const auto observations = observations_of(camera_, truth, rng_, 0.3);
    CeresReference reference;
    reference.add(PixelErrors{camera_.intrinsics(), observations}, observations.size());
    const Rigid3 tiny = refine(observations, truth, kNoHuber);
    EXPECT_THAT(tiny, IsNearPose(reference.solve(truth), tolerance_, tolerance_));
    EXPECT_NEAR(2 * solver_.summary.final_cost, reference.cost(), 1e-12 * reference.cost());
  }
}

TEST_F(Refinement, AgreesWithTheHuberLossOfCeres) {
  for (int i = 0; i < 50; ++i) {
    const Rigid3 truth = random_view(rng_, rng_.uniform(1.7, 6), rng_.uniform(10, 60) * kRadFromDeg);
    auto observations = observations_of(camera_, truth, rng_, 0.3);
    observations[static_cast<size_t>(rng_.index(24))].pixel.x() += 5;
    CeresReference reference;
    for (const auto& o : observations) {
      reference.add(PixelErrors{camera_.intrinsics(), {&o, 1}}, 1, new ceres::HuberLoss(kHuber));
    }
    const Rigid3 tiny = refine(observations, truth, kHuber);
    EXPECT_THAT(tiny, IsNearPose(reference.solve(truth), tolerance_, tolerance_));
    EXPECT_NEAR(2 * solver_.summary.final_cost, reference.cost(), 1e-12 * reference.cost());
  }
}

}  // namespace
}  // namespace perch
