#include <cmath>

#include "perch/pose/pose_estimator.h"
#include "support/near_pose.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

// Statistics of the estimate over many draws of noise: does it err as it says, and choose as it promises?
namespace perch {
namespace {

class PoseConsistency : public testing::Test {
 protected:
  PoseResult estimate(const Rigid3& truth, double noise_px, double sigma_px,
                      std::span<const NormalHint> hints = {}) {
    return estimator_.estimate(seen(target_, camera_, truth, rng_, noise_px, sigma_px), hints);
  }
  // The mean normalised error squared over draws at a range and a tilt where there is but one minimum.
  double mean_nees(double range, double noise_px, double sigma_px, int draws) {
    double sum = 0;
    for (int i = 0; i < draws; ++i) {
      const Rigid3 truth = random_view(rng_, range, rng_.uniform(25, 50) * kRadFromDeg);
      const PoseResult result = estimate(truth, noise_px, sigma_px);
      EXPECT_EQ(result.status, PoseStatus::kOk);
      sum += normalised_error_squared(pose_error(result.camera_from_target.mean, truth),
                                      result.camera_from_target.covariance);
    }
    return sum / draws;
  }

  LandingTarget target_ = sharp_target();
  CameraModel camera_ = wide_camera();
  PoseEstimator estimator_{target_, camera_, PoseOptions{}};
  TestRng rng_;
};

// What the covariance takes from the residuals instead of knowing: with 42 degrees of freedom and the prior's
// 8 the variance scatters by sqrt(2 * 42) / 50 = 18 %, and the mean of 1 / variance is above 1 by 0.18^2.
// Huber's estimate at two sigma has a variance 1.018 of that of least squares; (8 + 42 * 0.865) / 50 /
// 0.922^2 = 1.043 is what it says, the prior not knowing that psi^2 is 0.865 and not 1.
constexpr double kBias = 1.034 * 1.018 / 1.043;
// The mean of n chi-squares of 6 over a variance that scatters by 18 %.
double scatter(int n) { return std::sqrt((2 * 6 + 36 * 0.18 * 0.18) / n); }

TEST_F(PoseConsistency, ErrorsAreAsLargeAsTheCovarianceSays) {
  constexpr int kDraws = 1000;
  for (const double range : {2.0, 4.0, 6.0}) {
    const double nees = mean_nees(range, 0.2, 0.2, kDraws);
    EXPECT_NEAR(nees, 6 * kBias, 4 * scatter(kDraws)) << range;
  }
}

TEST_F(PoseConsistency, CovarianceFollowsTheNoiseThatIsThereRatherThanTheStatedOne) {
  constexpr int kDraws = 1000;
  // Half of what is stated: 42 of 50 parts of the variance are measured, 8 are the stated. (8 + 42 / 4) / 50
  // = 0.37 of it where 0.25 would be right.
  const double half = mean_nees(4, 0.1, 0.2, kDraws);
  EXPECT_NEAR(half, 6 * kBias * 0.25 / 0.37, 4 * scatter(kDraws));
  // Twice: with the bound at one deviation of what is there psi^2 is 1.574 and psi' is 0.592. It says (8 + 42
  // * 1.574) / 50 / 0.592^2 = 4.23 where 1.574 / 0.592^2 = 4.49 would be right, and leaves out Huber's K^2
  // for 6 parameters of 48 errors, 1.15 here (and 1.02 above).
  const double twice = mean_nees(4, 0.4, 0.2, kDraws);
  EXPECT_NEAR(twice, 6 * 1.034 * 4.49 / 4.23 * 1.15, 1.2 * 4 * scatter(kDraws));
}

TEST_F(PoseConsistency, OneWrongCornerMovesThePoseByFractionsOfItsDeviation) {
  double clean = 0, spoilt = 0, nees = 0;
  constexpr int kDraws = 800;
  for (int i = 0; i < kDraws; ++i) {
    const Rigid3 truth = random_view(rng_, 4, rng_.uniform(25, 50) * kRadFromDeg);
    auto correspondences = seen(target_, camera_, truth, rng_, 0.2, 0.2);
    const PoseResult before = estimator_.estimate(correspondences);
    // 3 px, fifteen sigma, in any direction.
    const double direction = rng_.uniform(-M_PI, M_PI);
    correspondences[static_cast<size_t>(rng_.index(24))].pixel +=
        3 * Eigen::Vector2d(std::cos(direction), std::sin(direction));
    const PoseResult after = estimator_.estimate(correspondences);
    ASSERT_EQ(after.status, PoseStatus::kOk);
    const auto& C = before.camera_from_target.covariance;
    clean += normalised_error_squared(pose_error(before.camera_from_target.mean, truth), C) / kDraws;
    spoilt += normalised_error_squared(pose_error(after.camera_from_target.mean, truth), C) / kDraws;
    nees += normalised_error_squared(pose_error(after.camera_from_target.mean, truth),
                                     after.camera_from_target.covariance) /
            kDraws;
  }
  // Huber lets it pull with two sigma, half of what the 4 sigma^2 of a corner weigh among 24: as if 24
  // corners of variance 1 had one of variance 4 and no more; least squares would take all fifteen, 225 / 24.
  EXPECT_LE(spoilt, 1.5 * clean);
  // And the covariance knows.
  EXPECT_LE(nees, 6 * kBias + 4 * scatter(kDraws));
}

// The promise of min_evidence = 9. Let D be the chi-square between the pictures of two poses. The difference
// of their costs is then normal about D with variance 4 D, and the wrong one is taken for sure when it is
// below -9: at most Phi(-3) = 0.135 %, where D = 9; elsewhere less. That the variance is an estimate from 50
// degrees of freedom makes it Student's t: 0.21 %. A wrong one is off by more than five of its sigmas, which
// noise alone does 15 times in a million.
constexpr double kPromised = 0.0021;

struct Counts {
  int ok = 0, ambiguous = 0, rejected = 0, wrong = 0;
};

class Choice : public PoseConsistency {
 protected:
  Counts count(double low_range, double high_range, int draws, double hint_sigma_deg = 0) {
    Counts counts;
    for (int i = 0; i < draws; ++i) {
      const Rigid3 truth =
          random_view(rng_, rng_.uniform(low_range, high_range), rng_.uniform(0, 40) * kRadFromDeg);
      const double noise = rng_.uniform(0.1, 0.5);
      std::vector<NormalHint> hints;
      if (hint_sigma_deg > 0) {
        const double sigma = hint_sigma_deg * kRadFromDeg;
        const Rigid3 tilted = perturb(truth, random_error(rng_, 0, sigma));
        hints.push_back({tilted.rotation * Eigen::Vector3d::UnitZ(), sigma});
      }
      const PoseResult result = estimate(truth, noise, noise, hints);
      counts.ambiguous += result.status == PoseStatus::kAmbiguous;
      counts.rejected += result.status == PoseStatus::kRejected;
      if (result.status != PoseStatus::kOk) continue;
      ++counts.ok;
      const Eigen::Vector3d turn = pose_error(result.camera_from_target.mean, truth).tail<3>();
      const Eigen::Matrix3d covariance = result.camera_from_target.covariance.bottomRightCorner<3, 3>();
      counts.wrong += !(turn.dot(covariance.ldlt().solve(turn)) <= 25);
    }
    RecordProperty("ok", counts.ok);
    RecordProperty("ambiguous", counts.ambiguous);
    RecordProperty("rejected", counts.rejected);
    RecordProperty("wrong", counts.wrong);
    return counts;
  }
  // As many as promised of those that are sure, and four deviations of such a count.
  static double allowed(const Counts& counts) {
    return kPromised * counts.ok + 4 * std::sqrt(kPromised * counts.ok);
  }
};

TEST_F(Choice, NearTheTargetIsSureAndRight) {
  const Counts counts = count(1.7, 3, 3000);
  EXPECT_LE(counts.wrong, allowed(counts));
  EXPECT_EQ(counts.ok, 3000);
}

TEST_F(Choice, AmidTheAmbiguityIsWrongNoMoreOftenThanTheEvidencePromises) {
  const Counts counts = count(3, 12, 10000);
  EXPECT_LE(counts.wrong, allowed(counts));
  EXPECT_GT(counts.ok, 5000);
  // Descents that do not come to an end in the flat valley of a face seen straight on: one in a thousand.
  EXPECT_LE(counts.rejected, 10);
}

TEST_F(Choice, FarAwayIsAmbiguousRatherThanWrong) {
  const Counts counts = count(15, 30, 3000);
  EXPECT_LE(counts.wrong, allowed(counts));
  EXPECT_GT(counts.ambiguous, 2000);
  EXPECT_LE(counts.rejected, 3);
}

TEST_F(Choice, GravityDecidesFarAway) {
  const Counts counts = count(12, 25, 3000, 3);
  EXPECT_LE(counts.wrong, allowed(counts));
  EXPECT_GT(counts.ok, 2000);
  EXPECT_LE(counts.rejected, 3);
}

}  // namespace
}  // namespace perch
