#include "perch/geometry/uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <limits>
#include <numbers>

#include "perch/geometry/so3.h"
#include "support/differentiate.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

PoseError random_error(TestRng& rng, double m, double rad) {
  PoseError error;
  error << rng.normal3(m), rng.normal3(rad);
  return error;
}

// A full covariance of some (m, rad): every position is correlated with every rotation.
PoseCovariance random_covariance(TestRng& rng, double m, double rad) {
  PoseCovariance covariance = PoseCovariance::Zero();
  for (int i = 0; i < 12; ++i) {
    const PoseError e = random_error(rng, m, rad);
    covariance += e * e.transpose() / 12;
  }
  return covariance;
}

PoseError draw(TestRng& rng, const Eigen::LLT<PoseCovariance>& llt) {
  return llt.matrixL() * random_error(rng, 1, 1);
}

// Checks a predicted covariance against samples of the error: whitened by the prediction, they must have the
// unit covariance.
class Samples {
 public:
  void add(const PoseError& error) {
    sum_ += error * error.transpose();
    ++count_;
  }
  // The elements of a unit covariance from N samples scatter by sqrt(2 / N) on the diagonal: five sigma,
  // for 36.
  void expect(const PoseCovariance& predicted) const {
    const PoseCovariance inverse_root = predicted.llt().matrixL().solve(PoseCovariance::Identity());
    const PoseCovariance white = inverse_root * (sum_ / count_) * inverse_root.transpose();
    EXPECT_THAT(white, IsNearMatrix(PoseCovariance::Identity(), 5 * std::sqrt(2.0 / count_)));
  }

 private:
  PoseCovariance sum_ = PoseCovariance::Zero();
  int count_ = 0;
};

constexpr int kSamples = 5000;
// Small, so that what first order leaves out, some 1e-3 of the deviation, is far below the scatter.
constexpr double kSigmaM = 0.01, kSigmaRad = 0.001;

TEST(Uncertainty, PerturbMovesByDAndTurnsByRInTheAxesOfTheDestination) {
  PoseError e;
  e << 1, 2, 3, 0, 0, std::numbers::pi / 2;
  const Rigid3 b_from_a{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX())), {10, 20, 30}};
  const Rigid3 moved = perturb(b_from_a, e);
  EXPECT_THAT(moved.translation, IsNearMatrix(Eigen::Vector3d(11, 22, 33), 0.0));
  // The point's direction in b is turned about b's z axis.
  const Eigen::Vector3d p = b_from_a.rotation * Eigen::Vector3d(0, 1, 0);
  EXPECT_THAT(moved.rotation * Eigen::Vector3d(0, 1, 0),
              IsNearMatrix(Eigen::Vector3d(-p.y(), p.x(), p.z()), 8 * kEpsilon));
}

TEST(Uncertainty, PoseErrorUndoesPerturb) {
  TestRng rng;
  for (const double rad : {0.0, 1e-8, 1e-3, 1.0, std::numbers::pi - 1e-6}) {
    const Rigid3 pose = rng.pose(10);
    PoseError e;
    e << rng.normal3(1), rad * rng.normal3().normalized();
    // Positions of some 50 m; near pi, Log sees w = 5e-7 but atan2 keeps it exact.
    EXPECT_THAT(pose_error(pose, perturb(pose, e)), IsNearMatrix(e, 32 * kEpsilon * 50)) << rad;
  }
}

TEST(Uncertainty, OfAProductHasTheJacobiansOfItsFactors) {
  TestRng rng;
  for (int i = 0; i < 50; ++i) {
    const Rigid3 a = rng.pose(3), b = rng.pose(3);
    const PoseError zero = PoseError::Zero();
    const auto by_a = numeric_jacobian(
        [&](const PoseError& e) { return pose_error(a * b, perturb(a, e) * b); }, zero, 1e-5);
    const auto by_b = numeric_jacobian(
        [&](const PoseError& e) { return pose_error(a * b, a * perturb(b, e)); }, zero, 1e-5);
    const PoseCovariance C_a = random_covariance(rng, 1, 1), C_b = random_covariance(rng, 1, 1);
    const UncertainRigid3 c = UncertainRigid3{a, C_a} * UncertainRigid3{b, C_b};
    // Differences of 1e-5 err by 1e-9 for numbers of some 10; they stand twice in the product.
    const PoseCovariance expected = by_a * C_a * by_a.transpose() + by_b * C_b * by_b.transpose();
    EXPECT_THAT(c.covariance, IsNearMatrix(expected, 1e-8 * expected.norm()));
    EXPECT_THAT(c.mean, IsNearPose(a * b, 0.0, 0.0));
  }
}

TEST(Uncertainty, OfAnInverseHasItsJacobian) {
  TestRng rng;
  for (int i = 0; i < 50; ++i) {
    const Rigid3 a = rng.pose(3);
    const auto by =
        numeric_jacobian([&](const PoseError& e) { return pose_error(inverse(a), inverse(perturb(a, e))); },
                         PoseError(PoseError::Zero()), 1e-5);
    const PoseCovariance C = random_covariance(rng, 1, 1);
    const PoseCovariance expected = by * C * by.transpose();
    EXPECT_THAT(inverse(UncertainRigid3{a, C}).covariance, IsNearMatrix(expected, 1e-8 * expected.norm()));
  }
}

TEST(Uncertainty, OfAProductAgreesWithSamples) {
  TestRng rng;
  const UncertainRigid3 a{rng.pose(3), random_covariance(rng, kSigmaM, kSigmaRad)};
  const UncertainRigid3 b{rng.pose(3), random_covariance(rng, kSigmaM, kSigmaRad)};
  const UncertainRigid3 c = a * b;
  const Eigen::LLT<PoseCovariance> a_llt(a.covariance), b_llt(b.covariance);
  Samples samples;
  for (int i = 0; i < kSamples; ++i) {
    const Rigid3 truth = perturb(a.mean, draw(rng, a_llt)) * perturb(b.mean, draw(rng, b_llt));
    samples.add(pose_error(c.mean, truth));
  }
  samples.expect(c.covariance);
}

TEST(Uncertainty, OfAnInverseAgreesWithSamples) {
  TestRng rng;
  const UncertainRigid3 a{rng.pose(3), random_covariance(rng, kSigmaM, kSigmaRad)};
  const UncertainRigid3 back = inverse(a);
  const Eigen::LLT<PoseCovariance> llt(a.covariance);
  Samples samples;
  for (int i = 0; i < kSamples; ++i) {
    samples.add(pose_error(back.mean, inverse(perturb(a.mean, draw(rng, llt)))));
  }
  samples.expect(back.covariance);
}

TEST(Uncertainty, InverseTwiceIsTheSameAndProductsGroupAsTheyLike) {
  TestRng rng;
  const UncertainRigid3 a{rng.pose(3), random_covariance(rng, 1, 1)};
  const UncertainRigid3 b{rng.pose(3), random_covariance(rng, 1, 1)};
  const UncertainRigid3 c{rng.pose(3), random_covariance(rng, 1, 1)};
  EXPECT_THAT(inverse(inverse(a)).covariance,
              IsNearMatrix(a.covariance, 1000 * kEpsilon * a.covariance.norm()));
  const PoseCovariance left = ((a * b) * c).covariance, right = (a * (b * c)).covariance;
  EXPECT_THAT(left, IsNearMatrix(right, 100 * kEpsilon * left.norm()));
  // (a b)^-1 = b^-1 a^-1, uncertainty and all.
  const PoseCovariance ab = inverse(a * b).covariance;
  EXPECT_THAT((inverse(b) * inverse(a)).covariance, IsNearMatrix(ab, 100 * kEpsilon * ab.norm()));
}

TEST(Uncertainty, ARotationErrorSwingsAFarPointSideways) {
  // 0.01 rad about z at 10 m along x: 0.1 m along y, and the two fully correlated.
  UncertainRigid3 a;
  a.covariance(5, 5) = 1e-4;
  const UncertainRigid3 c = a * UncertainRigid3{{Eigen::Quaterniond::Identity(), {10, 0, 0}}};
  EXPECT_NEAR(c.covariance(1, 1), 0.01, 1e-17);
  EXPECT_NEAR(c.covariance(1, 5), 0.001, 1e-18);
  EXPECT_EQ(c.covariance(0, 0), 0);
}

TEST(Uncertainty, NormalisedErrorOfADiagonalIsTheSumOfSquaredSigmas) {
  PoseCovariance C = PoseCovariance::Zero();
  C.diagonal() << 4, 9, 16, 1, 1, 25;
  PoseError e;
  e << 2, 3, 8, 0, -1, 10;
  EXPECT_NEAR(normalised_error_squared(e, C), 1 + 1 + 4 + 0 + 1 + 4, 32 * kEpsilon);
}

TEST(Uncertainty, NormalisedErrorOfHonestSamplesIsSixOnAverage) {
  TestRng rng;
  const PoseCovariance C = random_covariance(rng, kSigmaM, kSigmaRad);
  const Eigen::LLT<PoseCovariance> llt(C);
  double sum = 0;
  for (int i = 0; i < kSamples; ++i) sum += normalised_error_squared(draw(rng, llt), C);
  // Chi-squared with 6 degrees has variance 12: four sigma of the mean.
  EXPECT_NEAR(sum / kSamples, 6, 4 * std::sqrt(12.0 / kSamples));
}

TEST(Uncertainty, NormalisedErrorIsNanForACovarianceThatIsNone) {
  const PoseError e = PoseError::Ones();
  PoseCovariance negative = PoseCovariance::Identity();
  negative(2, 2) = -1;
  PoseCovariance with_nan = PoseCovariance::Identity();
  with_nan(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(normalised_error_squared(e, PoseCovariance::Zero())));
  EXPECT_TRUE(std::isnan(normalised_error_squared(e, negative)));
  EXPECT_TRUE(std::isnan(normalised_error_squared(e, with_nan)));
}

}  // namespace
}  // namespace perch
