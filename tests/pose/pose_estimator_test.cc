#include "perch/pose/pose_estimator.h"

#include <limits>
#include <utility>

#include "support/near_pose.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool is_finite(const UncertainRigid3& pose) {
  return pose.mean.translation.allFinite() && pose.mean.rotation.coeffs().allFinite() &&
         pose.covariance.allFinite();
}

// What must hold of any result, whatever went in.
void expect_sound(const PoseResult& result) {
  EXPECT_TRUE(is_finite(result.camera_from_target));
  EXPECT_TRUE(!result.second || is_finite(*result.second));
  EXPECT_TRUE(std::isfinite(result.reprojection_rms_px));
  EXPECT_GE(result.ambiguity, 0);
  EXPECT_LE(result.ambiguity, 1);
  if (result.status != PoseStatus::kOk && result.status != PoseStatus::kAmbiguous) return;
  EXPECT_GE(result.features, 4);
  EXPECT_NEAR(result.camera_from_target.mean.rotation.norm(), 1, 8 * kEpsilon);
  EXPECT_FALSE(std::isnan(normalised_error_squared(PoseError::Zero(), result.camera_from_target.covariance)));
}

class PoseEstimatorTest : public testing::Test {
 protected:
  PoseResult estimate(const std::vector<Correspondence>& correspondences,
                      std::span<const NormalHint> hints = {}) {
    const PoseResult result = estimator_.estimate(correspondences, hints);
    expect_sound(result);
    return result;
  }
  std::vector<Correspondence> seen_from(const Rigid3& truth, double noise_px = 0.2) {
    return seen(target_, camera_, truth, rng_, noise_px, 0.2);
  }

  LandingTarget target_ = sharp_target();
  CameraModel camera_ = wide_camera();
  PoseEstimator estimator_{target_, camera_, PoseOptions{}};
  TestRng rng_;
  Rigid3 truth_ = view(3, Eigen::Vector3d(0.05, -0.02, 1).normalized(), 0.5, 0.3, 1);
};

using PoseEstimation = PoseEstimatorTest;

TEST_F(PoseEstimation, FindsTheTruthOnExactData) {
  for (int i = 0; i < 300; ++i) {
    const double range = rng_.uniform(1.7, 10);
    const Rigid3 truth = random_view(rng_, range, rng_.uniform(10, 75) * kRadFromDeg);
    const PoseResult result = estimate(seen_from(truth, 0));
    ASSERT_EQ(result.status, PoseStatus::kOk) << range;
    EXPECT_EQ(result.features, 24);
    // The descent ends when the cost falls by less than 1e-6 and is quadratic there, so that what is left is
    // far less: its square, 1e-6 of a deviation of up to 0.3 rad and m; a factor of 30.
    EXPECT_THAT(result.camera_from_target.mean, IsNearPose(truth, 1e-5, 1e-5)) << range;
    EXPECT_LE(result.reprojection_rms_px, 1e-5);
  }
}

TEST_F(PoseEstimation, DoesNotDependOnTheCallsBefore) {
  const auto correspondences = seen_from(truth_);
  const PoseResult first = estimate(correspondences);
  estimate(seen_from(random_view(rng_, 8, 0.2)));
  estimate(std::vector(correspondences.begin(), correspondences.begin() + 7));
  estimate({});
  const PoseResult again = estimate(correspondences);
  EXPECT_THAT(again.camera_from_target.mean, IsNearPose(first.camera_from_target.mean, 0.0, 0.0));
  EXPECT_THAT(again.camera_from_target.covariance, IsNearMatrix(first.camera_from_target.covariance, 0.0));
  EXPECT_EQ(again.ambiguity, first.ambiguity);
}

TEST_F(PoseEstimation, ReprojectionErrorIsTheRootMeanSquareDistance) {
  auto correspondences = seen_from(truth_, 0);
  // All to the right by 0.1 px, but a pose can follow that; alternately up and down it cannot.
  for (size_t i = 0; i < correspondences.size(); ++i) correspondences[i].pixel.y() += i % 2 == 0 ? 0.1 : -0.1;
  const double rms = estimate(correspondences).reprojection_rms_px;
  EXPECT_LE(rms, 0.1);
  // Six of 48 numbers of 24 * 0.01 px^2 can be fitted away.
  EXPECT_GE(rms, 0.1 * std::sqrt(1 - 6.0 / 24));
}

TEST_F(PoseEstimation, FewerThanFourCornersArePartial) {
  const auto all = seen_from(truth_);
  for (const int count : {0, 1, 2, 3}) {
    const PoseResult result = estimate(std::vector(all.begin(), all.begin() + count));
    EXPECT_EQ(result.status, PoseStatus::kPartial);
    EXPECT_EQ(result.features, count);
  }
  EXPECT_EQ(estimate(std::vector(all.begin(), all.begin() + 4)).features, 4);
}

TEST_F(PoseEstimation, LeavesOutWhatIsNoMeasurement) {
  const auto good = seen_from(truth_);
  const PoseResult expected = estimate(std::vector(good.begin() + 1, good.end()));
  std::vector<Correspondence> bad(9, good[0]);
  bad[0].pixel.x() = kNan;
  bad[1].pixel.y() = kInfinity;
  bad[2].pixel = {1e6, 1e6};  // beyond what the lens can show
  bad[3].feature = -1;
  bad[4].feature = 24;
  bad[5].sigma_px = 0;
  bad[6].sigma_px = -1;
  bad[7].sigma_px = kNan;
  bad[8].sigma_px = kInfinity;
  for (size_t i = 0; i < bad.size(); ++i) {
    auto correspondences = good;
    correspondences[0] = bad[i];
    const PoseResult result = estimate(correspondences);
    EXPECT_EQ(result.status, PoseStatus::kOk) << i;
    EXPECT_EQ(result.features, 23) << i;
    EXPECT_THAT(result.camera_from_target.mean, IsNearPose(expected.camera_from_target.mean, 0.0, 0.0)) << i;
  }
}

TEST_F(PoseEstimation, AllAtOnePixelIsRejected) {
  auto correspondences = seen_from(truth_);
  for (auto& c : correspondences) c.pixel = {320, 240};
  EXPECT_EQ(estimate(correspondences).status, PoseStatus::kRejected);
}

TEST_F(PoseEstimation, AllOnOneLineIsRejected) {
  auto correspondences = seen_from(truth_);
  for (auto& c : correspondences) c.pixel.y() = 240;
  EXPECT_EQ(estimate(correspondences).status, PoseStatus::kRejected);
}

TEST_F(PoseEstimation, OneFeatureManyTimesIsRejected) {
  EXPECT_EQ(estimate(std::vector(24, seen_from(truth_)[0])).status, PoseStatus::kRejected);
}

TEST_F(PoseEstimation, AMirroredPictureIsRejected) {
  auto correspondences = seen_from(truth_);
  for (auto& c : correspondences) c.pixel.x() = 640 - c.pixel.x();
  EXPECT_EQ(estimate(correspondences).status, PoseStatus::kRejected);
}

TEST_F(PoseEstimation, GarbageLabelsAreRejected) {
  for (int i = 0; i < 500; ++i) {
    auto correspondences = seen_from(random_view(rng_, rng_.uniform(1.7, 5), rng_.uniform(0, 1)));
    for (size_t k = correspondences.size() - 1; k > 0; --k) {
      std::swap(correspondences[k].feature,
                correspondences[static_cast<size_t>(rng_.index(static_cast<int>(k) + 1))].feature);
    }
    EXPECT_EQ(estimate(correspondences).status, PoseStatus::kRejected) << i;
  }
}

TEST_F(PoseEstimation, TwoSquaresExchangedAreRejected) {
  // The layout's own mirror image about its diagonal: B for F, C for E.
  auto correspondences = seen_from(truth_);
  for (int k = 0; k < 4; ++k) {
    std::swap(correspondences[static_cast<size_t>(4 + k)].feature,
              correspondences[static_cast<size_t>(20 + k)].feature);
    std::swap(correspondences[static_cast<size_t>(8 + k)].feature,
              correspondences[static_cast<size_t>(16 + k)].feature);
  }
  EXPECT_EQ(estimate(correspondences).status, PoseStatus::kRejected);
}

TEST_F(PoseEstimation, AHintThatIsNoneChangesNothing) {
  const auto correspondences = seen_from(random_view(rng_, 15, 0.4));
  const PoseResult without = estimate(correspondences);
  const Eigen::Vector3d normal(0, 0, -1);
  for (const NormalHint& hint :
       {NormalHint{{kNan, 0, -1}, 0.1}, NormalHint{normal, 0.0}, NormalHint{normal, -1.0},
        NormalHint{normal, kNan}, NormalHint{{0, 0, 0}, 0.1}}) {
    const PoseResult result = estimate(correspondences, {&hint, 1});
    EXPECT_EQ(result.status, without.status);
    EXPECT_THAT(result.camera_from_target.mean, IsNearPose(without.camera_from_target.mean, 0.0, 0.0));
  }
}

TEST_F(PoseEstimation, AHintDecidesAndDoesNotMoveTheMinimum) {
  for (int i = 0; i < 50; ++i) {
    const Rigid3 truth = random_view(rng_, 15, 0.5);
    const auto correspondences = seen_from(truth);
    const PoseResult without = estimate(correspondences);
    ASSERT_TRUE(without.second);
    // WHEN something says that the face is turned as in the one minimum or the other, THEN that one it is.
    const Rigid3 minima[] = {without.camera_from_target.mean, without.second->mean};
    for (const Rigid3& minimum : minima) {
      const NormalHint hint{minimum.rotation * Eigen::Vector3d::UnitZ(), 2 * kRadFromDeg};
      const PoseResult result = estimate(correspondences, {&hint, 1});
      EXPECT_EQ(result.status, PoseStatus::kOk) << i;
      EXPECT_THAT(result.camera_from_target.mean, IsNearPose(minimum, 0.0, 0.0)) << i;
      EXPECT_EQ(result.ambiguity, without.ambiguity);
    }
  }
}

// Anything a broken detector may send: never a crash, never a number that is none.
TEST_F(PoseEstimation, SurvivesAnything) {
  const double numbers[] = {kNan, kInfinity, -kInfinity, 0, 1e300, -1e300, 1e-300, 1e9, -1};
  const auto broken = [&] { return numbers[rng_.index(static_cast<int>(std::size(numbers)))]; };
  int ok = 0;
  for (int i = 0; i < 5000; ++i) {
    auto correspondences =
        seen_from(random_view(rng_, std::pow(10, rng_.uniform(-0.5, 2)), rng_.uniform(0, 1.5)),
                  std::pow(10, rng_.uniform(-3, 3)));
    if (correspondences.empty()) continue;
    for (int k = rng_.index(6); k > 0; --k) {
      auto& c = correspondences[static_cast<size_t>(rng_.index(static_cast<int>(correspondences.size())))];
      switch (rng_.index(5)) {
        case 0:
          c.pixel.x() = broken();
          break;
        case 1:
          c.pixel.y() = broken();
          break;
        case 2:
          c.sigma_px = broken();
          break;
        case 3:
          c.feature = rng_.index(60) - 20;
          break;
        default:
          correspondences.push_back(c);
      }
    }
    correspondences.resize(static_cast<size_t>(rng_.index(static_cast<int>(correspondences.size()) + 1)));
    ok += estimate(correspondences).status == PoseStatus::kOk;
  }
  EXPECT_GT(ok, 500);  // not everything was thrown away
}

}  // namespace
}  // namespace perch
