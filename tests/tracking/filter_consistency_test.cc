#include <Eigen/Cholesky>
#include <cmath>

#include "perch/geometry/so3.h"
#include "perch/tracking/filter.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

constexpr double kStep = 1.0 / 30;  // s
constexpr int kSeeds = 50;
constexpr int kSteps = 330;

int64_t time_of(int step) { return std::llround(step * kStep * 1e9); }

// The vehicle the filter believes in: white acceleration of density q^2, integrated exactly over a step.
class RandomVehicle {
 public:
  RandomVehicle(TestRng& rng, const TrackingOptions& options) : rng_(rng), options_(options) {
    pad_from_body_ = rng.pose(5);
    velocity_ = rng.normal3(options.initial_velocity_sigma);
    angular_velocity_ = rng.normal3(options.initial_angular_velocity_sigma);
  }

  void step() {
    const auto [p, v] = noise(options_.acceleration_noise);
    const auto [r, w] = noise(options_.angular_acceleration_noise);
    pad_from_body_.translation += velocity_ * kStep + p;
    pad_from_body_.rotation = (so3_exp(angular_velocity_ * kStep + r) * pad_from_body_.rotation).normalized();
    velocity_ += v;
    angular_velocity_ += w;
  }

  // A measurement that errs as it says, with position and rotation correlated.
  UncertainRigid3 measurement() {
    PoseCovariance root = PoseCovariance::Zero();
    root.diagonal() << 0.01, 0.01, 0.03, 0.01, 0.01, 0.003;
    root(3, 1) = 0.005;
    PoseError error;
    error << rng_.normal3(), rng_.normal3();
    return {perturb(pad_from_body_, root * error), root * root.transpose()};
  }

  Eigen::Matrix<double, 12, 1> error_of(const VehicleState& state) const {
    Eigen::Matrix<double, 12, 1> error;
    error << pose_error(state.pad_from_body, pad_from_body_), velocity_ - state.body_velocity_in_pad,
        angular_velocity_ - state.body_angular_velocity_in_pad;
    return error;
  }

 private:
  // (position, velocity) after a step: variances q^2 dt^3 / 3 and q^2 dt, covariance q^2 dt^2 / 2.
  std::pair<Eigen::Vector3d, Eigen::Vector3d> noise(double q) {
    const Eigen::Vector3d v = rng_.normal3(q * std::sqrt(kStep));
    return {kStep / 2 * v + rng_.normal3(q * std::sqrt(kStep * kStep * kStep / 12)), v};
  }

  TestRng& rng_;
  TrackingOptions options_;
  Rigid3 pad_from_body_;
  Eigen::Vector3d velocity_, angular_velocity_;
};

struct Consistency {
  Eigen::ArrayXd mean_nees = Eigen::ArrayXd::Zero(kSteps);  // at each step over the seeds
  double mean_nis = 0;                                      // over steps and seeds
  int innovations = 0;
};

// `truth` moves the vehicle, `options` are what the filter believes.
Consistency fly(const TrackingOptions& truth, const TrackingOptions& options) {
  Consistency result;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    TestRng rng(seed);
    RandomVehicle vehicle(rng, truth);
    VehicleFilter filter(options);
    for (int i = 0; i < kSteps; ++i) {
      if (i > 0) vehicle.step();
      const UncertainRigid3 seen = vehicle.measurement();
      if (const auto predicted = filter.predict(time_of(i))) {
        const PoseCovariance S = predicted->covariance.topLeftCorner<6, 6>() + seen.covariance;
        result.mean_nis += normalised_error_squared(pose_error(predicted->pad_from_body, seen.mean), S);
        ++result.innovations;
      }
      const auto state = filter.update(time_of(i), seen);
      const auto error = vehicle.error_of(*state);
      const Eigen::LLT<Eigen::Matrix<double, 12, 12>> llt(state->covariance);
      result.mean_nees(i) += error.dot(llt.solve(error)) / kSeeds;
    }
  }
  result.mean_nis /= result.innovations;
  return result;
}

TrackingOptions without_gate() {
  TrackingOptions options;
  // One honest measurement in 10,000 is refused: the statistics are to be those of all.
  options.gate = 1e9;
  return options;
}

TEST(FilterConsistency, ErrorsAreAsLargeAsTheCovarianceSays) {
  const Consistency flown = fly(without_gate(), without_gate());
  // The mean of 50 chi-squares of 12 degrees of freedom: variance 2 * 12 / 50, 95 % within 1.96 sigma. A
  // second apart, many times the filter's memory, the moments are independent; of ten, fewer than eight
  // inside happens once in a hundred.
  const double bound = 1.96 * std::sqrt(2 * 12.0 / kSeeds);
  int inside = 0;
  for (int i = 30; i < kSteps; i += 30) inside += std::abs(flown.mean_nees(i) - 12) <= bound;
  EXPECT_GE(inside, 8);
  // At the start nothing is known but the measurement and the prior; it counts like any other moment.
  EXPECT_LE(std::abs(flown.mean_nees(0) - 12), 4 * std::sqrt(2 * 12.0 / kSeeds));
}

TEST(FilterConsistency, InnovationsAreAsLargeAsTheirCovarianceSays) {
  const Consistency flown = fly(without_gate(), without_gate());
  // Innovations are white: all of them are independent chi-squares of 6, the mean within four sigma.
  EXPECT_LE(std::abs(flown.mean_nis - 6), 4 * std::sqrt(2 * 6.0 / flown.innovations)) << flown.mean_nis;
}

TEST(FilterConsistency, WouldNoticeAFilterThatTrustsItsModelTooMuch) {
  TrackingOptions calm = without_gate();
  calm.acceleration_noise /= 3;
  calm.angular_acceleration_noise /= 3;
  const Consistency flown = fly(without_gate(), calm);
  EXPECT_GT(flown.mean_nees(300), 12 + 4 * std::sqrt(2 * 12.0 / kSeeds));
  EXPECT_GT(flown.mean_nis, 6 + 4 * std::sqrt(2 * 6.0 / flown.innovations));
}

}  // namespace
}  // namespace perch
