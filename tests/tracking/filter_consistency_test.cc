// Whether the filter's errors are as large as it says: normalised squares of innovations (NIS) and of errors
// (NEES) over 50 flights of the very motion a hypothesis assumes, from vision alone and with an autopilot.

#include <Eigen/Cholesky>
#include <cmath>

#include "perch/geometry/so3.h"
#include "perch/tracking/filter.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

using Eigen::Vector3d;

// With 400 in their place NIS is 5.978 to 6.030 in all six cases, each within its 95 % bound of +-0.040.
constexpr int kSeeds = 50;
// Frames at 30 Hz and samples at 50 Hz are both whole numbers of these.
constexpr int kStepsPerSecond = 450, kStepsPerFrame = 15, kStepsPerSample = 9;
constexpr double kStep = 1.0 / kStepsPerSecond;  // s
constexpr int kFrames = 121;

int64_t time_of(int step) { return std::llround(step * kStep * 1e9); }

// All of one in 10,000 is refused in flight: the statistics are to be those of all.
TrackingOptions without_gate() {
  TrackingOptions options;
  options.gate = 1e9;
  // Rounding of a straight line into the curves of a turning deck grows with the way.
  options.initial_velocity_sigma = 0.5;
  return options;
}

// A body and a pad driven by white noise: the equations of Motion, in steps that are small against a frame.
class RandomVehicle {
 public:
  RandomVehicle(TestRng& rng, const BodyNoise& body, const PadNoise& pad, const TrackingOptions& options)
      : rng_(rng), body_(body), pad_(pad) {
    pad_from_body_ = rng.pose(2);
    velocity_ = rng.normal3(options.initial_velocity_sigma);
    angular_velocity_ = rng.normal3(options.initial_angular_velocity_sigma);
    world_from_pad_ = rng.rotation();
    pad_velocity_ = rng.normal3(pad.velocity_sigma);
    pad_angular_velocity_ = rng.normal3(pad.angular_velocity_sigma);
  }

  void step() {
    const double root = std::sqrt(kStep);
    const Vector3d push = rng_.normal3(body_.acceleration * root);
    const Vector3d turn = rng_.normal3(body_.angular_acceleration * root);
    const Vector3d pad_push = rng_.normal3(pad_.acceleration * root);
    const Vector3d pad_turn = rng_.normal3(pad_.angular_acceleration * root);
    Vector3d& p = pad_from_body_.translation;
    const Vector3d v = velocity_, w = angular_velocity_, W = pad_angular_velocity_;
    velocity_ += push - pad_push - pad_turn.cross(p) - (2 * W.cross(v) + W.cross(W.cross(p))) * kStep;
    angular_velocity_ += turn - pad_turn;
    pad_angular_velocity_ += pad_turn;
    pad_velocity_ += pad_push - W.cross(pad_velocity_) * kStep;
    p += (v + velocity_) / 2 * kStep;
    pad_from_body_.rotation =
        (so3_exp((w + angular_velocity_) / 2 * kStep) * pad_from_body_.rotation).normalized();
    const Vector3d wander = rng_.normal3(pad_.wander * root);
    world_from_pad_ =
        (world_from_pad_ * so3_exp((W + pad_angular_velocity_) / 2 * kStep + wander)).normalized();
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

  AutopilotSample sample(int64_t time) {
    AutopilotSample sample;
    sample.timestamp_ns = time;
    sample.world_from_body =
        so3_exp(rng_.normal3(sample.attitude_sigma)) * (world_from_pad_ * pad_from_body_.rotation);
    const Vector3d in_pad =
        pad_velocity_ + velocity_ + pad_angular_velocity_.cross(pad_from_body_.translation);
    sample.body_velocity_in_world = world_from_pad_ * in_pad + rng_.normal3(sample.velocity_sigma);
    sample.angular_velocity_in_body =
        pad_from_body_.rotation.conjugate() * (angular_velocity_ + pad_angular_velocity_) +
        rng_.normal3(sample.angular_velocity_sigma);
    return sample;
  }

  Eigen::Matrix<double, 12, 1> error_of(const VehicleState& state) const {
    Eigen::Matrix<double, 12, 1> error;
    error << pose_error(state.pad_from_body, pad_from_body_), velocity_ - state.body_velocity_in_pad,
        angular_velocity_ - state.body_angular_velocity_in_pad;
    return error;
  }

 private:
  TestRng& rng_;
  BodyNoise body_;
  PadNoise pad_;
  Rigid3 pad_from_body_;
  Vector3d velocity_, angular_velocity_, pad_velocity_, pad_angular_velocity_;
  Eigen::Quaterniond world_from_pad_;
};

struct Consistency {
  Eigen::ArrayXd mean_nees = Eigen::ArrayXd::Zero(kFrames);  // at each frame over the seeds
  double mean_nis = 0;                                       // over frames and seeds, from `kSettled` on
  int innovations = 0;
  double velocity_rms = 0;  // m/s, likewise
};
// By then it has chosen what to believe of body and pad.
constexpr int kSettled = 50;  // frames

struct Case {
  std::string name;
  size_t body, pad;  // which hypothesis is true
  bool aided;
};

// `options` are what the filter believes.
Consistency fly(const Case& truth, const TrackingOptions& options) {
  Consistency result;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    TestRng rng(seed);
    RandomVehicle vehicle(rng, body_hypotheses(without_gate())[truth.body],
                          pad_hypotheses(without_gate())[truth.pad], without_gate());
    VehicleFilter filter(options);
    for (int i = 0; i < kFrames * kStepsPerFrame; ++i) {
      if (i > 0) vehicle.step();
      if (truth.aided && i % kStepsPerSample == 0) filter.hear(vehicle.sample(time_of(i)));
      if (i % kStepsPerFrame != 0) continue;
      const int frame = i / kStepsPerFrame;
      const UncertainRigid3 seen = vehicle.measurement();
      if (const auto predicted = filter.predict(time_of(i)); predicted && frame >= kSettled) {
        const PoseCovariance S = predicted->covariance.topLeftCorner<6, 6>() + seen.covariance;
        result.mean_nis += normalised_error_squared(pose_error(predicted->pad_from_body, seen.mean), S);
        ++result.innovations;
      }
      const auto state = filter.update(time_of(i), seen);
      const auto error = vehicle.error_of(*state);
      const Eigen::LLT<Eigen::Matrix<double, 12, 12>> llt(state->covariance);
      result.mean_nees(frame) += error.dot(llt.solve(error)) / kSeeds;
      if (frame >= kSettled) result.velocity_rms += error.segment<3>(6).squaredNorm();
    }
  }
  result.mean_nis /= result.innovations;
  result.velocity_rms = std::sqrt(result.velocity_rms / result.innovations);
  return result;
}

class FilterConsistency : public testing::TestWithParam<Case> {};

TEST_P(FilterConsistency, ErrorsAndInnovationsAreAsLargeAsTheirCovariancesSay) {
  const Consistency flown = fly(GetParam(), without_gate());
  // The mean of 50 chi-squares of 12 degrees of freedom: variance 2 * 12 / 50, 95 % within 1.96 sigma. A
  // third of a second apart, longer than the velocity's memory, the moments are all but independent; of ten,
  // fewer than eight inside happens once in a hundred.
  const double bound = 1.96 * std::sqrt(2 * 12.0 / kSeeds);
  int inside = 0, moments = 0;
  double mean = 0;
  for (int i = kSettled; i < kFrames; i += 10, ++moments) {
    inside += std::abs(flown.mean_nees(i) - 12) <= bound;
    mean += flown.mean_nees(i);
  }
  mean /= moments;
  std::cout << GetParam().name << ": NEES " << mean << " (12, each moment within +-" << bound << ": "
            << inside << " of " << moments << "), NIS " << flown.mean_nis << " (6 +- "
            << 1.96 * std::sqrt(2 * 6.0 / flown.innovations) << "), velocity RMS " << flown.velocity_rms
            << " m/s\n";
  EXPECT_GE(inside, moments - 2);
  EXPECT_LE(std::abs(mean - 12), bound);
  // At the start nothing is known but the measurement and the prior; it counts like any other moment. With an
  // autopilot both pads are equally likely then: errors over one that stands are smaller than the mixture
  // says, over one that moves at 2 m/s they are half as large again.
  const double start = flown.mean_nees(0) - 12, chance = 4 * std::sqrt(2 * 12.0 / kSeeds);
  EXPECT_GE(start, GetParam().aided ? -6 - chance : -chance);
  EXPECT_LE(start, chance + (GetParam().aided && GetParam().pad == 0 ? 6 : 0));
  // Innovations are white: all of them are independent chi-squares of 6, the mean within four sigma.
  EXPECT_LE(std::abs(flown.mean_nis - 6), 4 * std::sqrt(2 * 6.0 / flown.innovations));
}

INSTANTIATE_TEST_SUITE_P(Motions, FilterConsistency,
                         testing::Values(Case{"VisionLively", 0, 1, false}, Case{"VisionCalm", 2, 1, false},
                                         Case{"FusedLivelyStanding", 0, 1, true},
                                         Case{"FusedCalmStanding", 2, 1, true},
                                         Case{"FusedLivelyMoving", 0, 0, true},
                                         Case{"FusedCalmMoving", 2, 0, true}),
                         [](const auto& test) { return test.param.name; });

TEST(FilterConsistencyAlone, WouldNoticeAFilterThatTrustsItsModelTooMuch) {
  TrackingOptions calm = without_gate();
  calm.acceleration_noise /= 3;
  calm.angular_acceleration_noise /= 3;
  const Consistency flown = fly({"VisionLively", 0, 1, false}, calm);
  EXPECT_GT(flown.mean_nees.tail(kFrames - kSettled).mean(), 12 + 4 * std::sqrt(2 * 12.0 / kSeeds));
  EXPECT_GT(flown.mean_nis, 6 + 4 * std::sqrt(2 * 6.0 / flown.innovations));
}

}  // namespace
}  // namespace perch
