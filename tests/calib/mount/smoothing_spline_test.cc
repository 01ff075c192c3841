#include "calib/mount/smoothing_spline.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cmath>

#include "support/rng.h"

namespace perch {
namespace {

constexpr double kGap = 0.5;

// A vehicle's motion: some metres within seconds.
Eigen::Vector4d motion(double t) {
  return {0.7 * std::sin(0.86 * t) + 0.3 * std::sin(2 * t), 2 * std::sin(0.3 * t), 0.2 * std::sin(3.3 * t),
          0};
}

struct Samples {
  std::vector<double> times;
  std::vector<Eigen::Vector4d> values;
};

Samples sampled(TestRng& rng, double duration, double rate, double noise) {
  Samples s;
  for (int i = 0; i < static_cast<int>(duration * rate); ++i) {
    const double t = i / rate + rng.uniform(-0.1, 0.1) / rate;
    s.times.push_back(t);
    s.values.push_back(motion(t));
    s.values.back().head<3>() += rng.normal3(noise);
  }
  return s;
}

TEST(SmoothingSpline, KnowsTheNoiseAndHowFarItIsOff) {
  double squared = 0;
  int count = 0;
  for (unsigned seed = 0; seed < 5; ++seed) {
    TestRng rng(seed);
    const Samples s = sampled(rng, 60, 50, 0.02);
    const SmoothingSpline spline(s.times, s.values, kGap);
    // 9000 numbers: to 0.75 %, at four deviations.
    EXPECT_NEAR(spline.noise(), 0.02, 0.03 * 0.02);
    for (double t = 0.5; t < 59; t += 0.31) {
      const auto p = spline.at(t);
      ASSERT_TRUE(p);
      squared += (p->value - motion(t)).squaredNorm() / (p->variance_part * spline.noise() * spline.noise());
      count += 3;
      EXPECT_LT(p->variance_part, 0.1);  // of fifty samples a second many are averaged
    }
  }
  // Neighbours share their noise: some 1000 are independent. Sines are smoother than any white x''', so it is
  // rather on the safe side.
  EXPECT_GT(squared / count, 0.6);
  EXPECT_LT(squared / count, 1.15);
}

// The rate is the value's own derivative, and nothing jumps at a sample: the least squares over the time
// offset depend on it.
TEST(SmoothingSpline, HasNoKinks) {
  TestRng rng;
  const Samples s = sampled(rng, 3, 100, 0.02);
  const SmoothingSpline spline(s.times, s.values, kGap);
  constexpr double kStep = 1e-5;
  for (size_t i = 10; i < 280; i += 7) {
    for (const double t : {s.times[i], s.times[i] + 0.003}) {
      const Eigen::Vector4d difference =
          (spline.at(t + kStep)->value - spline.at(t - kStep)->value) / (2 * kStep);
      // Rounding, 1e-16 / 1e-5, and the third derivative (1e4 of this noise) times 1e-10 / 6.
      EXPECT_LT((spline.at(t)->rate - difference).norm(), 1e-6);
      EXPECT_LT((spline.at(t + kStep)->rate - spline.at(t - kStep)->rate).norm(), 0.02);
    }
  }
}

TEST(SmoothingSpline, MeetsSamplesWithoutNoise) {
  TestRng rng;
  const Samples s = sampled(rng, 20, 20, 0);
  const SmoothingSpline spline(s.times, s.values, kGap);
  EXPECT_LT(spline.noise(), 1e-4);
  for (double t = 0.5; t < 19; t += 0.13) {
    EXPECT_LT((spline.at(t)->value - motion(t)).norm(), 1e-6) << t;
  }
}

// The textbook's way: a white third derivative is a Gaussian process, here with a broad start; of the first
// axis, all over sigma^2.
struct Process {
  const Samples& samples;
  double density;

  double covariance(double a, double b) const {
    const double begin = samples.times[0] - 1e-9;
    const double m = std::min(a, b) - begin, d = std::abs(a - b);
    constexpr double kBroad = 1e6;
    // int_0^m (m - u)^2 (m + d - u)^2 / 4 du, and the start's.
    return density * (std::pow(m, 5) / 20 + d * std::pow(m, 4) / 8 + d * d * std::pow(m, 3) / 12) +
           kBroad * (1 + m * (m + d) + m * m * (m + d) * (m + d) / 4);
  }
  // Mean and variance of x(t) given all samples.
  Eigen::Vector2d at(double t) const {
    const auto n = static_cast<Eigen::Index>(samples.times.size());
    Eigen::MatrixXd K = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd k(n), y(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double ti = samples.times[static_cast<size_t>(i)];
      y[i] = samples.values[static_cast<size_t>(i)][0];
      k[i] = covariance(ti, t);
      for (Eigen::Index j = 0; j < n; ++j) K(i, j) += covariance(ti, samples.times[static_cast<size_t>(j)]);
    }
    const Eigen::VectorXd weights = K.ldlt().solve(k);
    return {weights.dot(y), covariance(t, t) - weights.dot(k)};
  }
};

TEST(SmoothingSpline, IsTheMeanAndTheVarianceOfAGaussianProcess) {
  TestRng rng;
  const Samples many = sampled(rng, 2, 20, 0.05);
  const SmoothingSpline spline(many.times, many.values, kGap);
  ASSERT_GT(spline.noise(), 0);
  // Its density is its own affair: the one whose variance at one moment is the spline's must suit all others.
  double low = 1e-3, high = 1e12;
  while (high / low > 1.0001) {
    const double middle = std::sqrt(low * high);
    const double variance = Process{many, middle}.at(many.times[20])[1];
    (variance < spline.at(many.times[20])->variance_part ? low : high) = middle;
  }
  for (const double t : {many.times[0], 0.512, 1.0, many.times[25], 1.33, 1.9}) {
    const auto p = spline.at(t);
    ASSERT_TRUE(p);
    const Eigen::Vector2d expected = Process{many, low}.at(t);
    // The broad start leaves a millionth, times the numbers' own size of some 1e3.
    EXPECT_NEAR(expected[0], p->value[0], 1e-4) << t;
    EXPECT_NEAR(expected[1], p->variance_part, 2e-3 * p->variance_part) << t;
  }
}

// Eight samples tell no noise and are followed as closely as any are: q = 100 sigma^2 / (0.1 s)^5. Half a
// hundredth of the variance between them is what the motion may do there.
TEST(SmoothingSpline, KnowsWhatItDoesNotKnowBetweenItsSamples) {
  Samples few;
  for (int i = 0; i < 8; ++i) {
    few.times.push_back(0.1 * i);
    few.values.push_back(motion(0.1 * i));
  }
  const SmoothingSpline spline(few.times, few.values, kGap);
  EXPECT_EQ(spline.noise(), 0);
  for (const double t : {0.3, 0.33, 0.35, 0.44}) {
    EXPECT_NEAR(spline.at(t)->variance_part, (Process{few, 1e7}.at(t)[1]), 1e-3) << t;
  }
}

TEST(SmoothingSpline, DoesNotBridgeGapsAndEndsWithItsSamples) {
  const std::vector<double> times = {0, 0.1, 0.2, 0.3, 2, 3, 3.1};
  std::vector<Eigen::Vector4d> values;
  for (const double t : times) values.push_back(motion(t));
  const SmoothingSpline spline(times, values, kGap);
  EXPECT_FALSE(spline.at(-0.01));
  EXPECT_TRUE(spline.at(0));
  EXPECT_TRUE(spline.at(0.25));
  EXPECT_FALSE(spline.at(1));
  EXPECT_THAT(spline.at(2)->value[0], testing::DoubleNear(motion(2)[0], 1e-9));
  EXPECT_FALSE(spline.at(2.01));
  EXPECT_TRUE(spline.at(3.05));
  EXPECT_TRUE(spline.at(3.1));
  EXPECT_FALSE(spline.at(3.11));
  EXPECT_FALSE(SmoothingSpline({}, {}, kGap).at(0));
}

}  // namespace
}  // namespace perch
