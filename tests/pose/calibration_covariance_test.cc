#include "perch/pose/calibration_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "perch/pose/pose_estimator.h"
#include "support/near_pose.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

Observation place(double x, double y) { return {{x, y, 0}, Eigen::Vector2d::Zero(), 1}; }

// As 20 boards leave a lens of wide_camera()'s kind: 0.1 % of the focal length, 1 px of the centre,
// distortions with correlations.
Eigen::MatrixXd usual_covariance(TestRng& rng) {
  const Eigen::Index n = 9;
  Eigen::VectorXd sigma(n);
  sigma << 0.6, 0.6, 1, 1, 2e-3, 5e-3, 2e-4, 2e-4, 5e-3;
  Eigen::MatrixXd mix(n, n);
  for (double& value : mix.reshaped()) value = rng.normal(0.4);
  mix += Eigen::MatrixXd::Identity(n, n);
  Eigen::MatrixXd correlation = mix * mix.transpose();
  const Eigen::VectorXd scale = correlation.diagonal().cwiseSqrt().cwiseInverse();
  correlation = scale.asDiagonal() * correlation * scale.asDiagonal();
  return sigma.asDiagonal() * correlation * sigma.asDiagonal();
}

CameraModel drawn(const CameraModel& truth, const Eigen::MatrixXd& root, TestRng& rng) {
  std::vector<double> intrinsics = truth.intrinsics();
  Eigen::VectorXd z(root.cols());
  for (double& value : z) value = rng.normal();
  const Eigen::VectorXd error = root * z;
  for (size_t i = 0; i < intrinsics.size(); ++i) intrinsics[i] += error(static_cast<Eigen::Index>(i));
  return CameraModel(truth.lens(), intrinsics, truth.width(), truth.height());
}

// Flights with wrong lenses, each drawn from what its calibration says of itself: the mean NEES, with the
// calibration's part in the covariance and without.
class CalibrationCovariance : public testing::TestWithParam<bool> {
 protected:
  double mean_nees(double range, int draws) {
    const Eigen::MatrixXd covariance = usual_covariance(rng_);
    const Eigen::MatrixXd root = covariance.llt().matrixL();
    double sum = 0;
    for (int i = 0; i < draws; ++i) {
      const CameraModel wrong = drawn(truth_, root, rng_).with_intrinsics_covariance(covariance);
      PoseOptions options;
      options.calibration_uncertainty = GetParam();
      PoseEstimator estimator(target_, wrong, options);
      const Rigid3 pose = random_view(rng_, range, rng_.uniform(25, 50) * kRadFromDeg);
      const PoseResult result = estimator.estimate(seen(target_, truth_, pose, rng_, 0.1, 0.1));
      EXPECT_EQ(result.status, PoseStatus::kOk);
      sum += normalised_error_squared(pose_error(result.camera_from_target.mean, pose),
                                      result.camera_from_target.covariance);
    }
    return sum / draws;
  }

  LandingTarget target_ = sharp_target();
  CameraModel truth_ = wide_camera();
  TestRng rng_;
};

// The mean of n chi-squares of 6 scatters by sqrt(12 / n), 0.18 here; the corners' own part is 1 % off it
// (pose_consistency_test). Without its part the covariance calls a lens impossible that it was told of.
TEST_P(CalibrationCovariance, MakesTheErrorOfAWrongLensAsLargeAsItSays) {
  constexpr int kDraws = 400;
  for (const double range : {2.0, 4.0}) {
    const double nees = mean_nees(range, kDraws);
    if (GetParam()) {
      EXPECT_NEAR(nees, 6, 0.25 + 4 * std::sqrt(12. / kDraws)) << range;
    } else {
      EXPECT_GT(nees, 20) << range;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(WithAndWithout, CalibrationCovariance, testing::Bool());

TEST(CalibrationCovarianceTerm, IsZeroWhenTheModelSaysNothing) {
  TestRng rng;
  const std::vector<Observation> features{place(0, 0), place(1, 0), place(0, 1)};
  EXPECT_TRUE(calibration_covariance(wide_camera(), features, random_view(rng, 4, 0.3)).isZero(0));
}

TEST(CalibrationCovarianceTerm, IsZeroWhereAFeatureCannotBeSeen) {
  TestRng rng;
  const CameraModel camera = wide_camera().with_intrinsics_covariance(usual_covariance(rng));
  const std::vector<Observation> features{place(0, 0), place(100, 0), place(0, 1)};
  EXPECT_TRUE(calibration_covariance(camera, features, random_view(rng, 4, 1.2)).isZero(0));
}

// A pinhole's focal length alone, seen straight on: the distance is off by the same part as the focal length.
TEST(CalibrationCovarianceTerm, OfAFocalLengthIsADistance) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(4, 4);
  covariance.topLeftCorner<2, 2>().setConstant(9);  // 3 px, fx and fy alike
  const CameraModel camera =
      CameraModel::pinhole(600, 600, 320, 240, 640, 480).with_intrinsics_covariance(covariance);
  const std::vector<Observation> square{place(0.5, 0.5), place(-0.5, 0.5), place(-0.5, -0.5),
                                        place(0.5, -0.5)};
  const PoseCovariance term =
      calibration_covariance(camera, square, view(10, Eigen::Vector3d::UnitZ(), 0, 0, 0));
  EXPECT_NEAR(std::sqrt(term(2, 2)), 10 * 3 / 600., 1e-9);  // rounding of the 6 x 6 solve
  EXPECT_NEAR(term.trace() - term(2, 2), 0, 1e-12);
}

TEST(CameraModelCovariance, RefusesWhatIsNone) {
  const CameraModel camera = CameraModel::pinhole(600, 600, 320, 240, 640, 480);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(4, 4);
  EXPECT_NO_THROW(camera.with_intrinsics_covariance(covariance));
  EXPECT_THROW(camera.with_intrinsics_covariance(Eigen::MatrixXd::Identity(5, 5)), std::invalid_argument);
  covariance(0, 1) = 0.5;
  EXPECT_THROW(camera.with_intrinsics_covariance(covariance), std::invalid_argument);
  covariance(1, 0) = covariance(0, 1) = 2;
  EXPECT_THROW(camera.with_intrinsics_covariance(covariance), std::invalid_argument);
  covariance(1, 0) = covariance(0, 1) = std::nan("");
  EXPECT_THROW(camera.with_intrinsics_covariance(covariance), std::invalid_argument);
}

}  // namespace
}  // namespace perch
