#include "calib/mount/pose_gate.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/mount/mount_covariance.h"
#include "perch/flight/head_angles.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

constexpr double kGate = 22.46;     // chi-square of 6 degrees of freedom at 0.999
constexpr size_t kMostPoses = 600;  // a flight, in this step: the rest only waits for the gate
constexpr int kRounds = 4;          // of noise and fit; the noise stands after two
// How far a time may still move: the start is within half a step of its grid (10 ms). A head's latency, 50
// ms.
constexpr int64_t kOffsetReach = 30'000'000, kLatencyReach = 100'000'000;  // ns

// Not at an end or gap of navigation or of the head's readings: a picture there would lose its prediction as
// soon as the offset moved, and the least squares refuse every step that does so.
bool is_inside(const MountProblem& problem, const MountFlight& flight, const Trajectory& trajectory,
               int64_t camera_ns, double offset) {
  const int64_t navigation_ns = camera_ns - std::llround(1e9 * offset);
  for (const int sign : {-1, 1}) {
    if (!trajectory.at(navigation_ns + sign * kOffsetReach)) return false;
    if (problem.chain.head && !head_angles_at(flight.gimbal, camera_ns + sign * kLatencyReach)) return false;
  }
  return true;
}

Matrix6d navigation_covariance(const NavigationNoise& noise, const Vector6d& part) {
  Vector6d white, drift;
  white << Eigen::Vector3d::Constant(noise.position), Eigen::Vector3d::Constant(noise.rotation);
  drift << Eigen::Vector3d::Constant(noise.position_drift), Eigen::Vector3d::Constant(noise.rotation_drift);
  return (part.cwiseProduct(white.cwiseAbs2()) + drift.cwiseAbs2()).asDiagonal();
}

std::optional<SightPrediction> predict(const MountProblem& problem, const MountSolution& solution, size_t f,
                                       size_t i) {
  const MountState& s = solution.state;
  const MountFlight& flight = problem.flights[f];
  if (!is_inside(problem, flight, solution.flights[f].trajectory, flight.sightings[i].timestamp_ns,
                 s.offsets[offset_of_flight(s, f)])) {
    return std::nullopt;
  }
  return predict_sight(
      {problem.chain, solution.flights[f].trajectory, flight.gimbal, flight.sightings[i].timestamp_ns},
      s.mount, s.pads[pad_of_flight(s, f)], s.offsets[offset_of_flight(s, f)], s.head);
}

Matrix6d pose_covariance(const UncertainRigid3& seen, const SightPrediction& p,
                         const NavigationNoise& noise) {
  return seen.covariance +
         p.by_correction * navigation_covariance(noise, p.noise_part) * p.by_correction.transpose();
}

void fit_poses(const MountProblem& problem, MountSolution& solution, bool free_head) {
  UnknownBlocks unknowns(solution.state);
  PoseManifold manifold;
  ceres::Problem::Options ownership;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem least_squares(ownership);
  ceres::CauchyLoss loss(3);
  for (size_t f = 0; f < problem.flights.size(); ++f) {
    const MountFlight& flight = problem.flights[f];
    const size_t step = std::max<size_t>(1, (flight.sightings.size() + kMostPoses - 1) / kMostPoses);
    for (size_t i = 0; i < flight.sightings.size(); i += step) {
      if (!flight.sightings[i].camera_from_target) continue;
      const auto p = predict(problem, solution, f, i);
      if (!p) continue;
      const UncertainRigid3& seen = *flight.sightings[i].camera_from_target;
      const Matrix6d covariance = pose_covariance(seen, *p, solution.flights[f].noise);
      const SightInputs inputs{problem.chain, solution.flights[f].trajectory, flight.gimbal,
                               flight.sightings[i].timestamp_ns};
      least_squares.AddResidualBlock(new SightCost(inputs, pose_term({seen.mean, covariance}), {}), &loss,
                                     unknowns.blocks(f, problem.chain.head.has_value()));
    }
  }
  if (least_squares.NumResidualBlocks() < 4)
    throw MountError(
        "fewer than 4 pictures lie within navigation's time (30 ms and more from its ends and gaps)");
  unknowns.add_manifolds(least_squares, manifold);
  add_priors(problem.options.priors, unknowns, least_squares);
  if (problem.chain.head && !free_head) least_squares.SetParameterBlockConstant(unknowns.head());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &least_squares, &summary);
  if (!summary.IsSolutionUsable()) throw MountError("the least squares on poses failed: " + summary.message);
  check_converged(least_squares, "poses", 1);  // Cauchy's loss is slow at the end, and only the gate follows
  solution.state = unknowns.state(solution.state);
}

// The pose that the picture has near the prediction: of a plane's two, the one the flight asks for.
std::optional<UncertainRigid3> pose_near(const CameraModel& camera, const Sighting& sight,
                                         const Rigid3& start) {
  ReprojectionErrors errors(camera);
  errors.observe(sight.observations);
  constexpr double kHuber = 2;
  ReprojectionCost cost(errors, start, kHuber);
  PoseSolver solver;
  PoseVector x = PoseVector::Zero();
  solver.Solve(cost, &x);
  LossSum sum;
  const Rigid3 pose = cost.pose(x);
  if (!ReprojectionCost(errors, pose, kHuber).sum(PoseVector::Zero(), true, &sum)) return std::nullopt;
  const double mean = sum.value / static_cast<double>(2 * sight.observations.size());
  if (!(mean < 16)) return std::nullopt;  // 4 deviations: no pose of this target
  const Matrix6d covariance = sum.half_curvature.inverse() * std::max(1.0, mean);
  if (!covariance.allFinite() || !(covariance.diagonal().minCoeff() > 0)) return std::nullopt;
  return UncertainRigid3{pose, covariance};
}

double squared_distance(const UncertainRigid3& seen, const SightPrediction& p, const NavigationNoise& noise) {
  return normalised_error_squared(pose_error(seen.mean, p.camera_from_target),
                                  pose_covariance(seen, p, noise));
}

void choose(MountProblem& problem, MountSolution& solution) {
  solution.chi_square = 0;
  solution.degrees = -6.0 * static_cast<double>(1 + solution.state.pads.size()) -
                     static_cast<double>(solution.state.offsets.size()) -
                     (problem.chain.head ? kHeadSize : 0);
  for (size_t f = 0; f < problem.flights.size(); ++f) {
    MountFlight& flight = problem.flights[f];
    FlightFit& fit = solution.flights[f];
    for (size_t i = 0; i < flight.sightings.size(); ++i) {
      Sighting& sight = flight.sightings[i];
      fit.used[i] = false;
      const auto p = predict(problem, solution, f, i);
      if (!p) continue;
      if (sight.camera_from_target)
        fit.misfit[i] = squared_distance(*sight.camera_from_target, *p, fit.noise);
      if (!(fit.misfit[i] < kGate) && sight.observations.size() >= 4) {
        if (const auto other = pose_near(flight.camera, sight, p->camera_from_target)) {
          const double misfit = squared_distance(*other, *p, fit.noise);
          if (misfit < kGate) {
            sight.camera_from_target = other;
            fit.misfit[i] = misfit;
          }
        }
      }
      fit.used[i] = fit.misfit[i] < kGate;
      if (!fit.used[i]) continue;
      solution.chi_square += fit.misfit[i];
      solution.degrees += 6;
    }
  }
}

// Measured noise that leaves a chi-square above 1 a degree of freedom is too small: of few pictures its
// median scatters, and what no model has is in it as well. Taken as it is, it would throw out good pictures
// and state deviations that are too small. Three rounds at most: what they do not mend is no noise.
void raise_noise(MountProblem& problem, MountSolution& solution) {
  constexpr double kTooLarge = 1.1;  // 5 % of the deviations
  const NavigationNoise& given = problem.options.noise;
  const auto scale = [](double by, double given_value, double* value) {
    if (!std::isfinite(given_value)) *value *= by;
  };
  for (int round = 0; round < 3 && solution.degrees > 0; ++round) {
    const double ratio = solution.chi_square / solution.degrees;
    if (!(ratio > kTooLarge)) return;
    for (FlightFit& fit : solution.flights) {
      scale(std::sqrt(ratio), given.position, &fit.noise.position);
      scale(std::sqrt(ratio), given.rotation, &fit.noise.rotation);
      scale(std::sqrt(ratio), given.position_drift, &fit.noise.position_drift);
      scale(std::sqrt(ratio), given.rotation_drift, &fit.noise.rotation_drift);
    }
    fit_poses(problem, solution, true);
    choose(problem, solution);
  }
}

}  // namespace

UnknownBlocks::UnknownBlocks(const MountState& state)
    : mount_(block_of(state.mount)), offsets_(state.offsets), head_(state.head) {
  for (const Rigid3& pad : state.pads) pads_.push_back(block_of(pad));
}

std::vector<double*> UnknownBlocks::blocks(size_t flight, bool with_head) {
  std::vector<double*> blocks = {mount_.data(), pads_[pads_.size() == 1 ? 0 : flight].data(),
                                 &offsets_[offsets_.size() == 1 ? 0 : flight]};
  if (with_head) blocks.push_back(head_.data());
  return blocks;
}

std::vector<double*> UnknownBlocks::all(bool with_head) {
  std::vector<double*> blocks = {mount_.data()};
  for (PoseBlock& pad : pads_) blocks.push_back(pad.data());
  for (double& offset : offsets_) blocks.push_back(&offset);
  if (with_head) blocks.push_back(head_.data());
  return blocks;
}

void UnknownBlocks::add_manifolds(ceres::Problem& problem, PoseManifold& manifold) {
  problem.SetManifold(mount_.data(), &manifold);
  for (PoseBlock& pad : pads_) problem.SetManifold(pad.data(), &manifold);
}

MountState UnknownBlocks::state(MountState state) const {
  const auto unit = [](Rigid3 pose) {
    pose.rotation = positive_w(pose.rotation.normalized());
    return pose;
  };
  state.mount = unit(pose_of(mount_.data()));
  for (size_t i = 0; i < pads_.size(); ++i) state.pads[i] = unit(pose_of(pads_[i].data()));
  state.offsets = offsets_;
  state.head = head_;
  return state;
}

namespace {

// x about a mean, each with its own deviation.
class VectorPrior : public ceres::CostFunction {
 public:
  VectorPrior(Eigen::VectorXd mean, Eigen::VectorXd sigma)
      : mean_(std::move(mean)), sigma_(std::move(sigma)) {
    set_num_residuals(static_cast<int>(mean_.size()));
    *mutable_parameter_block_sizes() = {static_cast<int>(mean_.size())};
  }
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    const Eigen::Index n = mean_.size();
    Eigen::Map<Eigen::VectorXd>(residuals, n) =
        (Eigen::Map<const Eigen::VectorXd>(x[0], n) - mean_).cwiseQuotient(sigma_);
    if (jacobians && jacobians[0]) {
      Eigen::Map<Eigen::MatrixXd>(jacobians[0], n, n) = Eigen::MatrixXd(sigma_.cwiseInverse().asDiagonal());
    }
    return true;
  }

 private:
  Eigen::VectorXd mean_, sigma_;
};

}  // namespace

std::vector<ceres::ResidualBlockId> add_priors(const MountPriors& priors, UnknownBlocks& unknowns,
                                               ceres::Problem& problem) {
  std::vector<ceres::ResidualBlockId> added;
  if (priors.body_from_base) {
    added.push_back(
        problem.AddResidualBlock(new PosePriorCost(*priors.body_from_base), nullptr, unknowns.mount()));
  }
  for (size_t i = 0; priors.world_from_pad && i < unknowns.pads(); ++i) {
    added.push_back(
        problem.AddResidualBlock(new PosePriorCost(*priors.world_from_pad), nullptr, unknowns.pad(i)));
  }
  for (size_t i = 0; priors.time_offset_sigma && i < unknowns.offsets(); ++i) {
    added.push_back(
        problem.AddResidualBlock(new VectorPrior(Eigen::VectorXd::Constant(1, priors.time_offset.value_or(0)),
                                                 Eigen::VectorXd::Constant(1, *priors.time_offset_sigma)),
                                 nullptr, unknowns.offset(i)));
  }
  if (problem.HasParameterBlock(unknowns.head())) {
    // The drawing's: 10 deg, 10 cm, 10 %, 50 ms.
    Eigen::VectorXd sigma(kHeadSize);
    sigma << 0.17, 0.17, 0.1, 0.1, 0.17, 0.17, 0.1, 0.1, 0.1, 0.1, 0.05;
    added.push_back(problem.AddResidualBlock(new VectorPrior(Eigen::VectorXd::Zero(kHeadSize), sigma),
                                             nullptr, unknowns.head()));
  }
  return added;
}

std::vector<std::optional<PoseError>> navigation_errors(const MountProblem& problem,
                                                        const MountFlight& flight, const FlightFit& fit,
                                                        const MountState& state, size_t f) {
  std::vector<std::optional<PoseError>> errors(flight.sightings.size());
  const Rigid3& pad = state.pads[pad_of_flight(state, f)];
  const double offset = state.offsets[offset_of_flight(state, f)];
  for (size_t i = 0; i < flight.sightings.size(); ++i) {
    const Sighting& sight = flight.sightings[i];
    if (!sight.camera_from_target) continue;
    const auto nav = fit.trajectory.at(sight.timestamp_ns - std::llround(1e9 * offset));
    const auto camera =
        body_from_camera(problem.chain, state.mount, state.head, flight.gimbal, sight.timestamp_ns);
    if (!nav || !camera) continue;
    const Rigid3 by_vision =
        pad * problem.chain.pad_from_target * inverse(*camera * sight.camera_from_target->mean);
    errors[i] = pose_error(by_vision, nav->world_from_body);
  }
  return errors;
}

NoiseSamples noise_samples(const MountProblem& problem, const MountSolution& solution, size_t f) {
  const MountFlight& flight = problem.flights[f];
  const auto errors = navigation_errors(problem, flight, solution.flights[f], solution.state, f);
  NoiseSamples samples;
  for (size_t i = 0; i < errors.size(); ++i) {
    if (!errors[i]) continue;
    const auto p = predict(problem, solution, f, i);
    if (!p) continue;
    const Sighting& sight = flight.sightings[i];
    const Matrix6d back = p->by_correction.inverse();
    samples.pictures.push_back(i);
    samples.times.push_back(1e-9 *
                            static_cast<double>(sight.timestamp_ns - flight.sightings[0].timestamp_ns));
    samples.errors.push_back(*errors[i]);
    samples.camera_variance.push_back(
        (back * sight.camera_from_target->covariance * back.transpose()).diagonal());
    samples.noise_part.push_back(p->noise_part);
  }
  return samples;
}

void pose_gate(MountProblem& problem, MountSolution& solution) {
  for (size_t f = 0; f < solution.flights.size(); ++f) {
    FlightFit& fit = solution.flights[f];
    fit.noise = first_noise(problem.options.noise, fit.trajectory, fit.start_misfit);
  }
  for (int round = 0; round < kRounds; ++round) {
    fit_poses(problem, solution, round > 0);
    for (size_t f = 0; f < problem.flights.size(); ++f) {
      FlightFit& fit = solution.flights[f];
      fit.noise = measured_noise(problem.options.noise, fit.trajectory, noise_samples(problem, solution, f));
    }
  }
  choose(problem, solution);
  raise_noise(problem, solution);
}

}  // namespace perch
