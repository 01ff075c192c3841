#include "perch/detection/edge_blur.h"

#include <gtest/gtest.h>

#include <vector>

#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

std::vector<WidthSample> samples(TestRng& rng, const Eigen::Matrix2d& blur, double sigma) {
  std::vector<WidthSample> samples;
  for (int i = 0; i < 60; ++i) {
    const double a = rng.uniform(0, 6.3);
    const Eigen::Vector2d n(std::cos(a), std::sin(a));
    samples.push_back({n, n.dot(blur * n) + rng.normal(sigma), sigma * sigma});
  }
  return samples;
}

TEST(EdgeBlur, FindsMotionInAnyDirection) {
  TestRng rng;
  for (int i = 0; i < 50; ++i) {
    const double a = rng.uniform(0, 3.2), along = rng.uniform(0.6, 4), across = 0.55;
    Eigen::Matrix2d R;
    R << std::cos(a), -std::sin(a), std::sin(a), std::cos(a);
    const Eigen::Matrix2d blur = R * Eigen::Vector2d(along, across).asDiagonal() * R.transpose();
    // Four sigma of three numbers from 60 samples, and a tenth by what was expected: a round 0.8 px.
    EXPECT_THAT(fit_blur(samples(rng, blur, 0.05), 0.8), IsNearMatrix(blur, 0.03 + 0.1 * (along - across)));
  }
}

TEST(EdgeBlur, IsWhatWasExpectedWithoutSamples) {
  EXPECT_THAT(fit_blur({}, 0.8), IsNearMatrix(0.64 * Eigen::Matrix2d::Identity(), 1e-9));
}

TEST(EdgeBlur, IsAlwaysACovariance) {
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    std::vector<WidthSample> wild;
    for (int k = rng.index(6); k > 0; --k) {
      wild.push_back(
          {Eigen::Vector2d(rng.normal(), rng.normal()).normalized(), rng.normal(30), rng.uniform(1e-3, 10)});
    }
    const Eigen::Matrix2d blur = fit_blur(wild, rng.uniform(0.5, 3));
    EXPECT_GT(blur.determinant(), 0);
    EXPECT_GT(blur(0, 0), 0);
    EXPECT_LT(blur.trace(), 33);
  }
}

}  // namespace
}  // namespace perch
