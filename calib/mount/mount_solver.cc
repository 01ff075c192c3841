#include "calib/mount/mount_solver.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/mount/mount_covariance.h"
#include "calib/mount/mount_start.h"
#include "calib/mount/pose_gate.h"
#include "calib/mount/trajectory_states.h"

namespace perch {
namespace {

// The last problem: pixels, trajectory corrections as states, one loss.
struct Bundle {
  ceres::Problem problem;
  UnknownBlocks unknowns;
  std::vector<std::unique_ptr<TrajectoryStates>> states;
  std::vector<ceres::ResidualBlockId> priors;
  PoseManifold manifold;

  explicit Bundle(const MountState& state) : problem(options()), unknowns(state) {}
  static ceres::Problem::Options options() {
    ceres::Problem::Options o;
    o.manifold_ownership = o.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return o;
  }
};

// Residuals of pictures in `pictures`; those of states and priors beside them.
void build(const MountProblem& problem, const MountSolution& solution, ceres::LossFunction* loss,
           Bundle& bundle) {
  for (size_t f = 0; f < problem.flights.size(); ++f) {
    const MountFlight& flight = problem.flights[f];
    const FlightFit& fit = solution.flights[f];
    std::vector<int64_t> times;
    for (size_t i = 0; i < flight.sightings.size(); ++i) {
      if (fit.used[i]) times.push_back(flight.sightings[i].timestamp_ns);
    }
    bundle.states.push_back(std::make_unique<TrajectoryStates>(
        fit.trajectory, fit.noise, times, solution.state.offsets[offset_of_flight(solution.state, f)]));
    TrajectoryStates& states = *bundle.states.back();
    states.add_priors(bundle.problem);
    size_t k = 0;
    for (size_t i = 0; i < flight.sightings.size(); ++i) {
      if (!fit.used[i]) continue;
      const auto parts = states.parts(k++);
      std::vector<double> weights;
      auto blocks = bundle.unknowns.blocks(f, problem.chain.head.has_value());
      for (const CorrectionPart& part : parts) {
        weights.push_back(part.weight);
        blocks.push_back(part.state);
      }
      const SightInputs inputs{problem.chain, fit.trajectory, flight.gimbal,
                               flight.sightings[i].timestamp_ns};
      bundle.problem.AddResidualBlock(
          new SightCost(inputs, pixel_term(flight.camera, flight.sightings[i]), weights), loss, blocks);
    }
  }
  bundle.unknowns.add_manifolds(bundle.problem, bundle.manifold);
  bundle.priors = add_priors(problem.options.priors, bundle.unknowns, bundle.problem);
}

void solve(ceres::Problem& problem) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  options.max_num_iterations = 100;
  options.num_threads = 2;
  options.function_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw MountError("the least squares failed: " + summary.message);
  check_converged(problem, "pixels", 0.1);
}

void bundle_adjust(const MountProblem& problem, MountSolution& solution) {
  // Cauchy on a picture's whole whitened error first, 24 corners' worth: what the gate let pass by luck. Then
  // plain least squares.
  for (const bool robust : {true, false}) {
    ceres::CauchyLoss loss(10);
    Bundle bundle(solution.state);
    ceres::Problem& p = bundle.problem;
    build(problem, solution, robust ? &loss : nullptr, bundle);
    solve(p);
    solution.state = bundle.unknowns.state(solution.state);
    if (!robust) measure_information(p, bundle.unknowns, bundle.priors, problem, solution);
  }
}

MountState configured(const MountProblem& problem, const std::vector<FlightStart>& starts) {
  MountState state;
  state.mount = problem.nominal_mount;
  for (size_t f = 0; f < starts.size(); ++f) {
    state.offsets.push_back(problem.nominal_offset);
    const auto pairs =
        hand_eye_pairs(problem, problem.flights[f], starts[f].trajectory, problem.nominal_offset, 300);
    state.pads.push_back(problem.nominal_pad.value_or(pad_of(pairs, problem.nominal_mount)));
  }
  return state;
}

MountState begun(const MountProblem& problem, const std::vector<FlightStart>& starts) {
  const auto best = std::min_element(starts.begin(), starts.end(), [](const auto& a, const auto& b) {
    return a.hand_eye.misfit < b.hand_eye.misfit;
  });
  MountState state;
  state.mount = best->hand_eye.mount;
  for (size_t f = 0; f < starts.size(); ++f) {
    if (f == 0 || !problem.options.shared_offset) state.offsets.push_back(starts[f].offset);
    if (f == 0 || !problem.options.shared_pad) {
      const auto pairs =
          hand_eye_pairs(problem, problem.flights[f], starts[f].trajectory, starts[f].offset, 300);
      state.pads.push_back(pad_of(pairs, state.mount));
    }
  }
  return state;
}

}  // namespace

MountSolution solve_mount(const MountProblem& problem, const Say& say) {
  const auto tell = [&](const std::string& text) {
    if (say) say(text);
  };
  if (problem.flights.empty()) throw MountError("no flight");
  MountSolution solution;
  std::vector<FlightStart> starts;
  for (const MountFlight& flight : problem.flights) {
    starts.push_back(start_flight(problem, flight));
    const FlightStart& s = starts.back();
    tell(flight.name + ": start at an offset of " + std::to_string(std::lround(1000 * s.offset)) +
         " ms, misfit " + std::to_string(s.hand_eye.misfit));
    const size_t n = flight.sightings.size();
    solution.flights.push_back({s.trajectory, problem.options.noise, std::vector<bool>(n, false),
                                std::vector<double>(n, NAN), std::vector<std::optional<PoseError>>(n),
                                std::vector<std::optional<PoseError>>(n), s.hand_eye.misfit});
  }
  solution.offset_costs = starts.front().costs;
  solution.start = configured(problem, starts);
  solution.state = begun(problem, starts);
  MountProblem gated = problem;  // the gate chooses between the planar minima
  pose_gate(gated, solution);
  tell("least squares on poses: done; now on the pixels");
  bundle_adjust(gated, solution);
  for (size_t f = 0; f < gated.flights.size(); ++f) {
    FlightFit& fit = solution.flights[f];
    fit.after = navigation_errors(gated, gated.flights[f], fit, solution.state, f);
    fit.before = navigation_errors(gated, gated.flights[f], fit, solution.start, f);
  }
  return solution;
}

}  // namespace perch
