#include "perch/analysis/latency_histogram.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "perch/analysis/statistics.h"
#include "support/rng.h"

namespace perch {
namespace {

// The width of a bucket: a quantile cannot be known better.
const double kWidth = std::exp2(1.0 / 16) - 1;

TEST(LatencyHistogram, KnowsTheQuantilesOfManyLatencies) {
  TestRng rng;
  LatencyHistogram histogram;
  std::vector<double> us;
  for (int i = 0; i < 20000; ++i) {
    us.push_back(std::exp(rng.uniform(std::log(5.0), std::log(2e6))));
    histogram.add(std::llround(1e3 * us.back()));
  }
  for (const double fraction : {0.01, 0.5, 0.9, 0.99, 1.0}) {
    const double exact = quantile(us, fraction);
    EXPECT_NEAR(histogram.quantile_us(fraction), exact, kWidth * exact) << fraction;
  }
  EXPECT_EQ(histogram.count(), us.size());
  EXPECT_NEAR(histogram.worst_us(), quantile(us, 1), 1e-3);  // whole ns
}

TEST(LatencyHistogram, OfOneValueEveryQuantileIsThatValue) {
  for (const int64_t ns : {1'500LL, 33'333'333LL, 100'000'000'000LL}) {
    LatencyHistogram histogram;
    histogram.add(ns);
    const double us = static_cast<double>(ns) * 1e-3;
    EXPECT_NEAR(histogram.quantile_us(0.5), us, kWidth * us);
    EXPECT_LE(histogram.quantile_us(0.99), histogram.worst_us());
  }
}

TEST(LatencyHistogram, OfNothingAllIsZero) {
  const LatencyHistogram histogram;
  EXPECT_EQ(histogram.count(), 0u);
  EXPECT_EQ(histogram.quantile_us(0.5), 0);
  EXPECT_EQ(histogram.worst_us(), 0);
}

TEST(LatencyHistogram, TakesAnyNumber) {
  LatencyHistogram histogram;
  for (const int64_t ns : {std::numeric_limits<int64_t>::min(), int64_t{-5}, int64_t{0}, int64_t{1},
                           std::numeric_limits<int64_t>::max()})
    histogram.add(ns);
  EXPECT_EQ(histogram.count(), 5u);
  EXPECT_LE(histogram.quantile_us(0.5), 2);
  EXPECT_EQ(histogram.worst_us(), static_cast<double>(std::numeric_limits<int64_t>::max()) * 1e-3);
}

TEST(LatencyHistogram, TwoTogetherAreOneOfBoth) {
  TestRng rng;
  LatencyHistogram first, second, both;
  for (int i = 0; i < 500; ++i) {
    const auto ns = static_cast<int64_t>(rng.uniform(0, 1e8));
    (i % 3 ? first : second).add(ns);
    both.add(ns);
  }
  first.add(second);
  EXPECT_EQ(first.count(), both.count());
  EXPECT_EQ(first.quantile_us(0.99), both.quantile_us(0.99));
  EXPECT_EQ(first.worst_us(), both.worst_us());
  first.clear();
  EXPECT_EQ(first.count(), 0u);
}

}  // namespace
}  // namespace perch
