#include "perch/import/time_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perch/geometry/so3.h"
#include "perch/simulation/gust.h"
#include "support/rng.h"

namespace perch {
namespace {

using testing::HasSubstr;

constexpr int64_t kCameraZero = 1'700'000'000'000'000'000;
constexpr double kPeriod = 1.0 / 30;

// A vehicle that gusts turn about, and a camera on it.
class Turning {
 public:
  explicit Turning(uint64_t seed) : random_(seed, 0), gust_(0.03, 1.5, random_) {}

  Eigen::Quaterniond world_from_body(double t) const { return so3_exp(gust_.value(t)); }
  Eigen::Vector3d rate(double t) const {
    constexpr double h = 1e-4;
    return so3_log(world_from_body(t - h).conjugate() * world_from_body(t + h)) / (2 * h);
  }
  // The vehicle's clock is that of t; with the noise of a cheap IMU, and its bias.
  std::vector<GyroSample> gyro(double begin, double end, TestRng& rng, double sigma = 0.003) const {
    std::vector<GyroSample> samples;
    for (double t = begin; t < end; t += 0.005) {
      samples.push_back(
          {std::llround(t * 1e9), rate(t) + Eigen::Vector3d(0.02, -0.01, 0.03) + rng.normal3(sigma)});
    }
    return samples;
  }
  // What a camera with a clock of its own sees: poses with an error of `sigma` each.
  std::vector<CameraTurn> turns(double begin, double end, double offset, TestRng& rng,
                                double sigma = 5e-4) const {
    std::vector<CameraTurn> turns;
    std::optional<std::pair<int64_t, Eigen::Quaterniond>> last;
    for (double t = begin; t < end; t += kPeriod) {
      const Eigen::Quaterniond pose = world_from_body(t) * body_from_camera * so3_exp(rng.normal3(sigma));
      const int64_t stamp = kCameraZero + std::llround((t + offset) * 1e9);
      if (last) {
        turns.push_back(
            {last->first, stamp, so3_log(last->second.conjugate() * pose), std::sqrt(2.0) * sigma, true});
      }
      last = {stamp, pose};
    }
    return turns;
  }
  Eigen::Quaterniond body_from_camera = Eigen::Quaterniond(0.1, 0.7, 0.7, -0.05).normalized();

 private:
  RandomStream random_;
  Gust gust_;
};

std::string refusal(const std::vector<CameraTurn>& turns, const std::vector<GyroSample>& gyro) {
  try {
    const auto found = align_times(turns, gyro);
    return "found " + std::to_string(found.offset_ns);
  } catch (const AlignmentError& e) {
    return e.what();
  }
}

double off_s(const TimeAlignment& found, double offset) {
  return static_cast<double>(found.offset_ns - kCameraZero) * 1e-9 - offset;
}

TEST(TimeAlignment, FindsTheOffsetTheMountAndHowWellItKnows) {
  double squares = 0;
  constexpr int kFlights = 12;
  for (int i = 0; i < kFlights; ++i) {
    TestRng rng(static_cast<unsigned>(i));
    Turning vehicle(rng.bits());
    vehicle.body_from_camera = rng.rotation();
    const double offset = rng.uniform(-0.5, 0.7);
    const auto found = align_times(vehicle.turns(10, 25, offset, rng), vehicle.gyro(2, 40, rng));
    const double off = off_s(found, offset);
    EXPECT_LT(std::abs(off), 0.005) << i;
    EXPECT_LT(std::abs(off), 4 * found.sigma) << i;
    EXPECT_LT(found.sigma, 0.003) << i;
    EXPECT_GT(found.sigma, 0.00005) << i;
    // Noise of 5e-4 rad over 0.1 s is 0.007 rad/s, a tenth of the turning; over 15 s a hundredth of it.
    EXPECT_LT(found.camera_from_body.angularDistance(vehicle.body_from_camera.conjugate()), 0.03) << i;
    EXPECT_GT(found.explained, 0.9);
    EXPECT_EQ(found.by_target, 1);
    squares += std::pow(off / found.sigma, 2);
  }
  // Chi-square with 12 degrees: 3.6 to 31 in 99.7 % of cases, had sigma no error itself.
  EXPECT_GT(squares, 3);
  EXPECT_LT(squares, 40);
}

TEST(TimeAlignment, FindsAShortVideoWithinALongLog) {
  TestRng rng;
  const Turning vehicle(7);
  const auto found = align_times(vehicle.turns(200, 212, -150.3, rng), vehicle.gyro(0, 300, rng));
  EXPECT_NEAR(off_s(found, -150.3), 0, 0.005);
}

TEST(TimeAlignment, TakesAttitudesWhereThereIsNoGyro) {
  TestRng rng;
  const Turning vehicle(3);
  NavTrack nav;
  for (double t = 5; t < 30; t += 0.02) {
    nav.samples.push_back({std::llround(t * 1e9), {vehicle.world_from_body(t), Eigen::Vector3d::Zero()}, {}});
  }
  const auto found = align_times(vehicle.turns(10, 25, 0.25, rng), angular_velocities(nav));
  EXPECT_NEAR(off_s(found, 0.25), 0, 0.005);
}

TEST(TimeAlignment, ALensThatJumpsNowAndThenCostsLittle) {
  TestRng rng;
  const Turning vehicle(4);
  auto turns = vehicle.turns(10, 25, 0.25, rng);
  for (size_t i = 20; i < turns.size(); i += 60) {  // the wrong one of a plane's two poses, for one picture
    turns[i].turn += Eigen::Vector3d(0.3, 0, 0);
    turns[i + 1].turn -= Eigen::Vector3d(0.3, 0, 0);
  }
  const auto found = align_times(turns, vehicle.gyro(2, 40, rng));
  EXPECT_NEAR(off_s(found, 0.25), 0, 0.005);
}

TEST(TimeAlignment, RefusesWhatDoesNotDecide) {
  TestRng rng;
  const Turning vehicle(5), other(6);
  // The video of another flight.
  EXPECT_THAT(refusal(other.turns(10, 25, 0, rng), vehicle.gyro(2, 40, rng)),
              HasSubstr("do not decide on an offset"));
  // A hover without a gust.
  Turning still(1);
  auto turns = still.turns(10, 25, 0, rng);
  for (auto& turn : turns) turn.turn = rng.normal3(5e-4);
  EXPECT_THAT(refusal(turns, vehicle.gyro(2, 40, rng)), HasSubstr("do not decide on an offset"));
  // A vehicle that swings evenly: each period is as good as the next.
  std::vector<GyroSample> swing;
  std::vector<CameraTurn> seen;
  for (int i = 0; i < 8000; ++i) {
    const double t = i * 0.005;
    swing.push_back({i * 5'000'000LL, {0.2 * std::sin(6 * t) + rng.normal(0.003), 0, 0}});
  }
  for (int i = 300; i < 750; ++i) {
    const double t = (i + 0.5) * kPeriod;
    seen.push_back({i * 33'333'333LL,
                    (i + 1) * 33'333'333LL,
                    {0.2 * std::sin(6 * t) * kPeriod + rng.normal(5e-4), 0, 0},
                    7e-4,
                    true});
  }
  EXPECT_THAT(refusal(seen, swing), HasSubstr("do not decide on an offset"));
}

TEST(TimeAlignment, SaysWhatIsTooShort) {
  TestRng rng;
  const Turning vehicle(5);
  EXPECT_THAT(refusal({}, vehicle.gyro(2, 40, rng)), HasSubstr("no two pictures in a row"));
  EXPECT_THAT(refusal(vehicle.turns(10, 10.5, 0, rng), vehicle.gyro(2, 40, rng)),
              HasSubstr("of 30 that are needed"));
  EXPECT_THAT(refusal(vehicle.turns(10, 12, 0, rng), vehicle.gyro(2, 40, rng)),
              HasSubstr("of 3 s that are needed"));
  EXPECT_THAT(refusal(vehicle.turns(10, 20, 0, rng), vehicle.gyro(2, 3, rng)),
              HasSubstr("the log is too short"));
  EXPECT_THAT(refusal(vehicle.turns(10, 20, 0, rng), {}), HasSubstr("the log tells of no turning"));
}

}  // namespace
}  // namespace perch
