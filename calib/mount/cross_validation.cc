#include "calib/mount/cross_validation.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr size_t kPieces = 9, kParts = 3;

// Which of the three parts a picture belongs to.
size_t part_of(const MountFlight& flight, size_t i) { return kPieces * i / flight.sightings.size() % kParts; }

std::vector<Rigid3> places_of(const MountProblem& problem, const MountSolution& solution, size_t f,
                              const MountState& state, const std::vector<bool>& which) {
  const MountFlight& flight = problem.flights[f];
  const FlightFit& fit = solution.flights[f];
  std::vector<Rigid3> places;
  for (size_t i = 0; i < flight.sightings.size(); ++i) {
    const Sighting& sight = flight.sightings[i];
    // A picture that left two poses has none of its own to show.
    if (!which[i] || !sight.camera_from_target) continue;
    const double offset = state.offsets[offset_of_flight(state, f)];
    const auto nav = fit.trajectory.at(sight.timestamp_ns - std::llround(1e9 * offset));
    const auto camera =
        body_from_camera(problem.chain, state.mount, state.head, flight.gimbal, sight.timestamp_ns);
    if (nav && camera) places.push_back(nav->world_from_body * *camera * sight.camera_from_target->mean);
  }
  return places;
}

Rigid3 middle_of(const std::vector<Rigid3>& places) {
  Rigid3 middle = places.front();
  const double n = static_cast<double>(places.size());
  for (int round = 0; round < 3; ++round) {
    Eigen::Vector3d move = Eigen::Vector3d::Zero(), turn = move;
    for (const Rigid3& place : places) {
      move += (place.translation - middle.translation) / n;
      turn += so3_log(place.rotation * middle.rotation.conjugate()) / n;
    }
    middle = {(so3_exp(turn) * middle.rotation).normalized(), middle.translation + move};
  }
  return middle;
}

HeldOut without(const MountProblem& problem, const MountSolution& solution, size_t part) {
  HeldOut result;
  MountProblem rest = problem;
  // What fewer pictures would say of navigation's noise is another matter.
  if (solution.flights.size() == 1) rest.options.noise = solution.flights[0].noise;
  std::vector<std::vector<bool>> within(problem.flights.size()), beyond(problem.flights.size());
  for (size_t f = 0; f < problem.flights.size(); ++f) {
    const MountFlight& flight = problem.flights[f];
    rest.flights[f].sightings.clear();
    for (size_t i = 0; i < flight.sightings.size(); ++i) {
      const bool held = part_of(flight, i) == part, used = solution.flights[f].used[i];
      beyond[f].push_back(used && held);
      within[f].push_back(used && !held);
      if (!held) rest.flights[f].sightings.push_back(flight.sightings[i]);
    }
  }
  try {
    const MountSolution other = solve_mount(rest);
    const PoseError by = pose_error(solution.state.mount, other.state.mount);
    result.moved = by.head<3>().norm();
    result.turned = by.tail<3>().norm();
    // Of an efficient estimate: what fewer pictures give differs from what all give by the difference of the
    // covariances. The noise is measured twice, hence at least a tenth.
    const Vector6d fewer = other.covariance.diagonal().head<6>(),
                   all = solution.covariance.diagonal().head<6>();
    const Vector6d variance = (fewer - all).cwiseMax(0.1 * fewer);
    result.moved_sigmas = by.cwiseQuotient(variance.cwiseSqrt()).cwiseAbs().maxCoeff();
    for (size_t f = 0; f < problem.flights.size(); ++f) {
      const Rigid3 about = other.state.pads[pad_of_flight(other.state, f)] * problem.chain.pad_from_target;
      result.within.push_back(pad_scatter(problem, solution, f, other.state, within[f], &about));
      result.beyond.push_back(pad_scatter(problem, solution, f, other.state, beyond[f], &about));
    }
  } catch (const MountError& e) {
    result.problem = e.what();
  }
  return result;
}

}  // namespace

PadScatter pad_scatter(const MountProblem& problem, const MountSolution& solution, size_t f,
                       const MountState& state, const std::vector<bool>& which, const Rigid3* about) {
  const std::vector<Rigid3> places = places_of(problem, solution, f, state, which);
  PadScatter scatter{places.size(), NAN, NAN};
  if (places.empty()) return scatter;
  const Rigid3 middle = about ? *about : middle_of(places);
  double position = 0, rotation = 0;
  for (const Rigid3& place : places) {
    position += (place.translation - middle.translation).squaredNorm();
    rotation += std::pow(place.rotation.angularDistance(middle.rotation), 2);
  }
  const double n = static_cast<double>(places.size());
  scatter.position = std::sqrt(position / n);
  scatter.rotation = std::sqrt(rotation / n);
  return scatter;
}

std::vector<HeldOut> cross_validate(const MountProblem& problem, const MountSolution& solution) {
  std::vector<HeldOut> all(kParts);
  tbb::parallel_for(size_t{0}, kParts, [&](size_t part) { all[part] = without(problem, solution, part); });
  return all;
}

}  // namespace perch
