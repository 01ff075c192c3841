#include "perch/analysis/statistics.h"

#include <cmath>

#include "perch/geometry/euler.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

TEST(Statistics, AgreeWithNumbersByHand) {
  const std::vector<double> values = {1, -1, 3,
                                      5};  // squares 1 + 1 + 9 + 25 = 36, sum 8, deviations -1 -3 1 3
  const Statistics s = statistics(values);
  EXPECT_EQ(s.count, 4u);
  EXPECT_DOUBLE_EQ(s.rms, 3);
  EXPECT_DOUBLE_EQ(s.mean, 2);
  EXPECT_DOUBLE_EQ(s.rms_without_mean, std::sqrt(5));
  EXPECT_DOUBLE_EQ(s.median, 2);  // of 1 1 3 5
  EXPECT_DOUBLE_EQ(s.p95, 3 + 0.85 * 2);
  EXPECT_DOUBLE_EQ(s.max, 5);
}

TEST(Statistics, OfOneValueAreThatValue) {
  const std::vector<double> values = {-2};
  const Statistics s = statistics(values);
  EXPECT_EQ(s.rms, 2);
  EXPECT_EQ(s.mean, -2);
  EXPECT_EQ(s.rms_without_mean, 0);
  EXPECT_EQ(s.median, 2);
  EXPECT_EQ(s.p95, 2);
  EXPECT_EQ(s.max, 2);
}

TEST(Statistics, OfNothingAreNotANumber) {
  for (const Statistics& s : {statistics({}), angle_statistics({})}) {
    EXPECT_EQ(s.count, 0u);
    for (const double value : {s.rms, s.mean, s.rms_without_mean, s.median, s.p95, s.p99, s.max}) {
      EXPECT_TRUE(std::isnan(value));
    }
  }
}

TEST(Statistics, AnglesAcrossPiHaveTheirMeanAtPi) {
  // The same two directions, 1 degree either side of pi: a plain mean would say 0, an RMS about it 179
  // degrees.
  const std::vector<double> values = {M_PI - kRadFromDeg, -M_PI + kRadFromDeg};
  const Statistics s = angle_statistics(values);
  EXPECT_NEAR(std::abs(s.mean), M_PI, 10 * kEpsilon);
  EXPECT_NEAR(s.rms_without_mean, kRadFromDeg, 10 * kEpsilon);
}

TEST(Statistics, WholeTurnsChangeNothing) {
  const std::vector<double> plain = {0.1, -0.2, 0.4}, turned = {0.1 + 2 * M_PI, -0.2, 0.4 - 4 * M_PI};
  const Statistics a = angle_statistics(plain), b = angle_statistics(turned);
  EXPECT_NEAR(a.mean, b.mean, 64 * kEpsilon);
  EXPECT_NEAR(a.rms, b.rms, 64 * kEpsilon);
  EXPECT_NEAR(a.max, b.max, 64 * kEpsilon);
}

TEST(Statistics, SmallAnglesAreOrdinaryNumbers) {
  // Skewed on purpose: the direction of the mean vector is not the mean.
  TestRng rng;
  std::vector<double> values;
  for (int i = 0; i < 200; ++i) values.push_back(0.05 + std::abs(rng.normal(0.2)));
  const Statistics a = angle_statistics(values), b = statistics(values);
  EXPECT_NEAR(a.mean, b.mean, 200 * kEpsilon);
  EXPECT_NEAR(a.rms, b.rms, 200 * kEpsilon);
  EXPECT_NEAR(a.rms_without_mean, b.rms_without_mean, 200 * kEpsilon);
}

TEST(Statistics, QuantileIsLinearBetweenValues) {
  EXPECT_DOUBLE_EQ(quantile({3, 1, 2}, 0), 1);
  EXPECT_DOUBLE_EQ(quantile({3, 1, 2}, 0.25), 1.5);
  EXPECT_DOUBLE_EQ(quantile({3, 1, 2}, 1), 3);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

TEST(Statistics, ChiSquareQuantilesAreThoseOfTheTables) {
  // Printed tables, four decimals.
  EXPECT_NEAR(chi_square_quantile(0.95, 2), 5.9915, 5e-5);
  EXPECT_NEAR(chi_square_quantile(0.025, 6), 1.2373, 5e-5);
  EXPECT_NEAR(chi_square_quantile(0.975, 6), 14.4494, 5e-5);
  EXPECT_NEAR(chi_square_quantile(0.975, 60), 83.2977, 5e-5);
  EXPECT_NEAR(chi_square_quantile(0.025, 100), 74.2219, 5e-5);
}

TEST(Statistics, ChiSquareQuantilesOfManyDegreesAreNormal) {
  // Wilson and Hilferty: the cube root is normal; at 60000 degrees of freedom good to better than 1e-8
  // relative.
  const int k = 60000;
  const double c = 2.0 / (9 * k), z = 1.959963985;
  EXPECT_NEAR(chi_square_quantile(0.975, k) / k, std::pow(1 - c + z * std::sqrt(c), 3), 1e-7);
  EXPECT_NEAR(chi_square_quantile(0.025, k) / k, std::pow(1 - c - z * std::sqrt(c), 3), 1e-7);
}

// How often of `runs` the interval of errors whose RMS is 1 holds it.
double coverage(int seconds, int each, bool alike, TestRng& rng) {
  constexpr int kRuns = 2000;
  int held = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<double> values;
    std::vector<int64_t> clusters;
    for (int second = 0; second < seconds; ++second) {
      const double common = rng.normal(1);
      for (int i = 0; i < each; ++i) {
        values.push_back(alike ? common : rng.normal(1));
        clusters.push_back(second);
      }
    }
    const RmsInterval interval = rms_interval(values, clusters);
    held += interval.low <= 1 && 1 <= interval.high;
  }
  return static_cast<double>(held) / kRuns;
}

TEST(RmsInterval, HoldsTheRms95TimesOf100) {
  TestRng rng;
  // 2000 runs scatter by 0.5 %; four of that. The mean of few squares is skewed, which costs some percent.
  EXPECT_NEAR(coverage(30, 10, false, rng), 0.95, 0.02);
  EXPECT_NEAR(coverage(5, 30, false, rng), 0.95, 0.02);
  EXPECT_NEAR(coverage(100, 10, true, rng), 0.94, 0.03);
  EXPECT_GT(coverage(10, 10, true, rng), 0.84);
}

TEST(RmsInterval, SaysNothingOfFewerThanThreeSeconds) {
  const std::vector<double> values = {1, 2, 3};
  EXPECT_TRUE(std::isnan(rms_interval(values, std::vector<int64_t>{1, 1, 2}).low));
  EXPECT_TRUE(std::isnan(rms_interval({}, {}).high));
  EXPECT_FALSE(std::isnan(rms_interval(values, std::vector<int64_t>{1, 2, 3}).high));
}

}  // namespace
}  // namespace perch
