#include "perch/analysis/attribution.h"

#include <gmock/gmock.h>

#include "analysis/flights.h"

namespace perch {
namespace {

// What the configuration lacks.
struct Mistake {
  PoseError mount = PoseError::Zero(), pad = PoseError::Zero();  // of the pad in its own axes
  double offset = 0, lens = 0;
};

constexpr double kNoise = 0.004;      // of the camera's pose, m
constexpr double kTurnNoise = 0.002;  // rad
constexpr double kSeconds = 20, kRate = 12;

// Over the pad with every motion that tells causes apart.
Rigid3 body_at(double t) {
  const YawPitchRoll angles{2 * std::sin(0.5 * t), 0.15 * std::sin(1.9 * t), M_PI + 0.15 * std::cos(1.3 * t)};
  return {rotation_from_ypr(angles),
          {1.5 * std::cos(1.1 * t), std::sin(0.8 * t), 5 + 2.5 * std::sin(0.4 * t)}};
}

Attribution attributed(const Mistake& mistake, unsigned seed = 1) {
  TestRng rng(seed);
  FrameChain chain;
  chain.body_from_base = Rigid3{rotation_from_ypr({M_PI / 2, 0.1, 0}), {0.2, -0.1, 0.1}};
  chain.world_from_pad = Rigid3{rotation_from_ypr({0.4, 0, M_PI}), {10, -5, 2}};
  const Rigid3 mount = perturb(*chain.body_from_base, mistake.mount);
  const Rigid3 moved{so3_exp(mistake.pad.tail<3>()), mistake.pad.head<3>()};
  const Rigid3 pad = *chain.world_from_pad * moved;
  Flight flight;
  for (int i = -50; i < 100 * kSeconds + 50; ++i) {
    const double t = 0.01 * i;  // of navigation's clock
    flight.nav.samples.push_back({kStartNs + std::llround(1e9 * t),
                                  *chain.world_from_pad * body_at(t + mistake.offset),
                                  Eigen::Vector3d::Zero()});
  }
  std::vector<Estimate> estimates;
  for (int i = 0; i < kSeconds * kRate; ++i) {
    const double t = i / kRate;
    Estimate estimate;
    estimate.timestamp_ns = kStartNs + std::llround(1e9 * t);
    estimate.status = EstimateStatus::kOk;
    Rigid3 seen = inverse(*chain.world_from_pad * body_at(t) * mount) * pad;
    seen.translation.z() /= 1 + mistake.lens;
    PoseError noise;
    noise << rng.normal3(kNoise), rng.normal3(kTurnNoise);
    estimate.camera_from_target.mean = perturb(seen, noise);
    estimate.pad_from_body = pad_from_body_by_vision(chain, estimate.camera_from_target, std::nullopt);
    estimates.push_back(estimate);
  }
  return attribute_errors(estimates, chain, flight);
}

const ErrorCause& cause(const Attribution& a, const std::string& name) {
  for (const ErrorCause& c : a.causes) {
    if (c.cause == name) return c;
  }
  throw std::runtime_error(name);
}

// The largest distance of a cause's values from the truth, in deviations.
double off(const ErrorCause& c, const std::vector<double>& truth) {
  double worst = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    worst = std::max(worst, std::abs(c.value[i] - truth[i]) / c.sigma[i]);
  }
  return worst;
}

// 4 deviations, and some for what is not linear in mistakes of this size.
constexpr double kNear = 5;

TEST(Attribution, FindsEachMistakeAndCallsItByItsName) {
  const struct {
    const char* name;
    Mistake mistake;
    std::vector<double> value;
  } kCases[] = {
      {"mount rotation", {.mount = {0, 0, 0, 0.02, -0.03, 0.025}}, {0.02, -0.03, 0.025}},
      {"lever arm", {.mount = {0.08, -0.05, 0.06, 0, 0, 0}}, {0.08, -0.05, 0.06}},
      {"pad position", {.pad = {0.2, -0.1, 0.15, 0, 0, 0}}, {0.2, -0.1, 0.15}},
      {"pad rotation", {.pad = {0, 0, 0, 0.01, -0.015, 0.02}}, {0.01, -0.015, 0.02}},
      {"time offset", {.offset = 0.04}, {0.04}},
      {"lens scale", {.lens = 0.01}, {0.01}},
  };
  for (const auto& c : kCases) {
    const Attribution a = attributed(c.mistake);
    ASSERT_GT(a.count, 200u) << c.name;
    EXPECT_EQ(a.causes[0].cause, c.name);
    EXPECT_LT(off(cause(a, c.name), c.value), kNear) << c.name;
    EXPECT_GT(cause(a, c.name).alone, 0.8) << c.name;
    // What is left is the noise: the camera's turned into the pad frame, where 2 mrad at 5 m are 1 cm.
    EXPECT_NEAR(a.rotation_noise, std::sqrt(3) * kTurnNoise, 0.1 * std::sqrt(3) * kTurnNoise) << c.name;
    EXPECT_LT(a.position_noise, 0.025) << c.name;
    for (const ErrorCause& other : a.causes) {
      if (other.cause == c.name) continue;
      EXPECT_LT(off(other, std::vector<double>(other.value.size(), 0.0)), 8) << c.name << ": " << other.cause;
      // The others together can do for much of it, of a lens' scale for most; no other one is missed as much.
      EXPECT_GT(cause(a, c.name).only_by_this, 5 * other.only_by_this) << c.name << ": " << other.cause;
    }
  }
}

TEST(Attribution, FindsSeveralAtOnce) {
  Mistake m;
  m.mount << 0.05, 0.02, -0.03, 0.01, 0.02, -0.01;
  m.pad << 0.1, -0.2, 0.05, 0, 0, 0.01;
  m.offset = -0.03;
  const Attribution a = attributed(m);
  EXPECT_LT(off(cause(a, "mount rotation"), {0.01, 0.02, -0.01}), 8);
  EXPECT_LT(off(cause(a, "lever arm"), {0.05, 0.02, -0.03}), 8);
  EXPECT_LT(off(cause(a, "pad position"), {0.1, -0.2, 0.05}), 8);
  EXPECT_LT(off(cause(a, "time offset"), {-0.03}), 8);
  EXPECT_LT(a.position_noise, 0.2 * a.position_rms);
}

TEST(Attribution, NoiseIsNobodysFault) {
  const Attribution a = attributed({});
  // 14 numbers fitted to 6 times 240 take a hundredth of the squares.
  for (const ErrorCause& c : a.causes) {
    EXPECT_LT(c.alone, 0.03) << c.cause;
    EXPECT_LT(off(c, std::vector<double>(c.value.size(), 0.0)), 4) << c.cause;
  }
  EXPECT_NEAR(a.position_noise, a.position_rms, 0.05 * a.position_rms);
}

TEST(Attribution, ToldByTheSummaryAndSilentWhereThereIsTooLittle) {
  TestRng rng;
  EXPECT_EQ(score_flight(make_flight({.frames = 5}, rng)).attribution.count, 0u);
  EXPECT_GT(score_flight(make_flight({.frames = 100, .noise = 0.01}, rng)).attribution.count, 80u);
}

}  // namespace
}  // namespace perch
