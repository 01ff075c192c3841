#include "calib/mount/mount_start.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "calib/mount/navigation_mistakes.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

// Of a start that is one: within 2 deg or 2 (3 cm + 1 % of the range) in the middle. Navigation with GPS of 1
// m is worse, hence more is allowed; a wrong convention leaves 50 and more.
constexpr double kGoodMisfit = 25;
constexpr size_t kPairs = 150;
constexpr double kOffsetStep = 0.02;  // s; the least squares converge from 0.2 s away

std::string time_text(int64_t ns) {
  std::ostringstream text;
  text.setf(std::ios::fixed);
  text.precision(3);
  text << 1e-9 * static_cast<double>(ns) << " s";
  return text.str();
}

std::string number(double value, int digits = 3) {
  std::ostringstream text;
  text.precision(digits);
  text << value;
  return text.str();
}

void check_times(const MountProblem& problem, const MountFlight& flight) {
  if (flight.nav.samples.size() < 2) {
    throw MountError(flight.name +
                     ": no navigation with an attitude: expected mav0/nav0/data.csv or "
                     "state_groundtruth_estimate0, without which the mount cannot be told from the pad");
  }
  if (flight.sightings.size() < 4) {
    throw MountError(flight.name + ": the target was found in " + std::to_string(flight.sightings.size()) +
                     " pictures; a mount needs 4 at least, and 60 s of them to be good");
  }
  const int64_t shift = std::llround(1e9 * problem.nominal_offset);
  const int64_t camera0 = flight.sightings.front().timestamp_ns,
                camera1 = flight.sightings.back().timestamp_ns;
  const int64_t nav0 = flight.nav.samples.front().timestamp_ns + shift,
                nav1 = flight.nav.samples.back().timestamp_ns + shift;
  const auto reach = std::llround(1e9 * problem.options.offset_reach);
  if (camera0 > nav1 + reach || nav0 > camera1 + reach) {
    throw MountError(flight.name + ": the clocks have no common time: the target was seen from " +
                     time_text(camera0) + " to " + time_text(camera1) +
                     ", navigation with frames.time_offset " + number(problem.nominal_offset) +
                     " runs from " + time_text(nav0) + " to " + time_text(nav1) + "; frames.time_offset: " +
                     number(problem.nominal_offset + 1e-9 * static_cast<double>(camera0 - nav0), 12) +
                     " would begin them together");
  }
}

// Whether anything moved at all.
void check_motion(const MountFlight& flight) {
  const Rigid3& first = flight.nav.samples.front().world_from_body;
  double moved = 0, turned = 0;
  for (const NavSample& s : flight.nav.samples) {
    moved = std::max(moved, (s.world_from_body.translation - first.translation).norm());
    turned = std::max(turned, s.world_from_body.rotation.angularDistance(first.rotation));
  }
  if (moved < 0.2 && turned < 3 * kRadFromDeg) {
    throw MountError(flight.name + ": a flight without motion (" + number(100 * moved) + " cm, " +
                     number(kDegFromRad * turned) +
                     " deg): nothing tells the mount from the pad's place; fly "
                     "over the target with roll and pitch of 10 deg, a full turn of yaw and changing height");
  }
}

FlightStart best_offset(const MountProblem& problem, const MountFlight& flight, Trajectory trajectory) {
  FlightStart best{std::move(trajectory), {}, problem.nominal_offset, {}};
  // A prior says where to look as well.
  const MountPriors& priors = problem.options.priors;
  const double middle = priors.time_offset.value_or(problem.nominal_offset);
  const double reach =
      std::min(problem.options.offset_reach, 3 * priors.time_offset_sigma.value_or(INFINITY));
  const int steps = static_cast<int>(std::ceil(reach / kOffsetStep));
  size_t most = 0;
  struct Tried {
    double offset;
    HandEye eye;
    size_t pairs;
  };
  std::vector<Tried> tried;
  for (int k = -steps; k <= steps; ++k) {
    const double offset = middle + k * kOffsetStep;
    const auto pairs = hand_eye_pairs(problem, flight, best.trajectory, offset, kPairs);
    if (pairs.size() < 4) continue;
    tried.push_back({offset, solve_hand_eye(pairs, problem.nominal_mount), pairs.size()});
    most = std::max(most, pairs.size());
  }
  for (const Tried& t : tried) {
    best.costs.push_back({t.offset, t.eye.misfit * t.eye.misfit});
    // An offset that throws most of the flight out of navigation's time fits the rest too easily.
    if (2 * t.pairs < most) continue;
    if (t.eye.misfit < best.hand_eye.misfit) {
      best.hand_eye = t.eye;
      best.offset = t.offset;
    }
  }
  return best;
}

}  // namespace

std::vector<HandEyePair> hand_eye_pairs(const MountProblem& problem, const MountFlight& flight,
                                        const Trajectory& trajectory, double offset, size_t most) {
  std::vector<HandEyePair> pairs;
  const size_t step = std::max<size_t>(1, (flight.sightings.size() + most - 1) / most);
  for (size_t i = 0; i < flight.sightings.size(); i += step) {
    const Sighting& sight = flight.sightings[i];
    if (!sight.camera_from_target) continue;
    const auto nav = trajectory.at(sight.timestamp_ns - std::llround(1e9 * offset));
    const auto base =
        body_from_camera(problem.chain, {}, HeadVector::Zero(), flight.gimbal, sight.timestamp_ns);
    if (!nav || !base) continue;
    pairs.push_back({nav->world_from_body,
                     *base * sight.camera_from_target->mean * inverse(problem.chain.pad_from_target)});
  }
  return pairs;
}

FlightStart start_flight(const MountProblem& problem, const MountFlight& flight) {
  check_times(problem, flight);
  check_motion(flight);
  const FlightStart start = best_offset(problem, flight, Trajectory(flight.nav));
  if (start.costs.empty()) {
    throw MountError(flight.name + ": fewer than 4 pictures of the target lie within navigation's time");
  }
  if (start.hand_eye.misfit > kGoodMisfit) {
    throw MountError(flight.name +
                     ": no mount makes navigation and vision agree: at best the middle picture is " +
                     number(start.hand_eye.misfit) + " units of 1 deg and 3 cm + 1 % of the range off; " +
                     explain_misfit(problem, flight, start));
  }
  const std::string better = usual_mistake(problem, flight, start);
  if (!better.empty()) throw MountError(flight.name + ": " + better);
  return start;
}

}  // namespace perch
