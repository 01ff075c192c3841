#include "perch/simulation/sensor.h"

#include <gmock/gmock.h>

#include <cmath>

#include "perch/simulation/random.h"

namespace perch {
namespace {

TEST(RandomStream, IsTheSameEverywhere) {
  RandomStream random(1);
  const uint64_t first = random.bits(), second = random.bits();
  // Recorded once: a change here changes every simulated flight.
  EXPECT_EQ(first, 9639420846141804449ULL);
  EXPECT_EQ(second, 5283499334869912440ULL);
  EXPECT_EQ(random.normal(), -0.14018065255183937);
  RandomStream again(1);
  EXPECT_EQ(again.bits(), first);
  EXPECT_EQ(again.bits(), second);
  EXPECT_NE(RandomStream(1, 1).bits(), first);
  EXPECT_NE(RandomStream(2).bits(), first);
}

TEST(RandomStream, NormalNumbersHaveTheMomentsOfANormalDistribution) {
  RandomStream random(3);
  constexpr int kCount = 1000000;
  double sum = 0, square = 0, fourth = 0;
  int beyond_two = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.normal();
    sum += x;
    square += x * x;
    fourth += x * x * x * x;
    beyond_two += std::abs(x) > 2;
  }
  // Four deviations of each estimate: 1, sqrt(2), sqrt(96) and sqrt(p (1 - p)) over sqrt(N).
  EXPECT_NEAR(sum / kCount, 0, 0.004);
  EXPECT_NEAR(square / kCount, 1, 0.0057);
  EXPECT_NEAR(fourth / kCount, 3, 0.04 + 0.035);  // the known lack of 0.03 and some
  EXPECT_NEAR(beyond_two / static_cast<double>(kCount), 0.0455, 0.0009);
}

TEST(Sensor, NoiseIsShotAndReadNoise) {
  SensorOptions options;
  options.full_well = 9000;
  options.read_noise = 12;
  const Sensor sensor(options);
  uint64_t seed = 0;
  for (const double light : {0.05, 0.2, 0.5, 0.8}) {
    const cv::Mat_<float> radiance(400, 500, static_cast<float>(light));
    cv::Scalar mean, deviation;
    cv::meanStdDev(sensor.picture(radiance, ++seed), mean, deviation);
    const double electrons = 9000 * light;
    const double variance = std::pow(255.0 / 9000, 2) * (electrons + 144) + 1.0 / 12;
    const double n = 400 * 500;
    // Four deviations of a mean, and of a variance (2 / N).
    EXPECT_NEAR(mean[0], 255 * light, 4 * std::sqrt(variance / n) + 1e-3);
    EXPECT_NEAR(deviation[0] * deviation[0] / variance, 1, 4 * std::sqrt(2 / n)) << light;
  }
}

TEST(Sensor, SaturatesAndStartsAtBlack) {
  const Sensor sensor;
  const cv::Mat_<float> dazzling(20, 20, 3.0F), dark(20, 20, 0.0F);
  EXPECT_EQ(cv::countNonZero(sensor.picture(dazzling, 1) != 255), 0);
  double most = 0;
  cv::minMaxLoc(sensor.picture(dark, 1), nullptr, &most);
  EXPECT_LE(most, 1);  // 7 e- of 10000 are a fifth of a grey level
  EXPECT_EQ(sensor.expected_grey(dazzling)(0, 0), 255);
}

TEST(Sensor, SrgbLiftsTheDarks) {
  SensorOptions options;
  options.response = Response::kSrgb;
  const Sensor sensor(options);
  // The standard's own numbers: 18 % grey is 118, half the light is 188.
  const cv::Mat_<float> radiance = (cv::Mat_<float>(1, 4) << 0.0F, 0.18F, 0.5F, 1.0F);
  const auto expected = sensor.expected_grey(radiance);
  EXPECT_NEAR(expected(0), 0, 1e-6);
  EXPECT_NEAR(expected(1), 117.6, 0.1);
  EXPECT_NEAR(expected(2), 187.5, 0.1);
  EXPECT_NEAR(expected(3), 255, 1e-4);
}

TEST(Sensor, SameSeedSameBytes) {
  const Sensor sensor;
  const cv::Mat_<float> radiance(48, 64, 0.4F);
  const auto picture = sensor.picture(radiance, 5, 17);
  EXPECT_EQ(cv::norm(picture, sensor.picture(radiance, 5, 17), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(picture, sensor.picture(radiance, 5, 18), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(picture, sensor.picture(radiance, 6, 17), cv::NORM_INF), 0);
}

}  // namespace
}  // namespace perch
