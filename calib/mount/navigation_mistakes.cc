#include "calib/mount/navigation_mistakes.h"

#include <array>
#include <cmath>
#include <functional>

namespace perch {
namespace {

struct Mistake {
  const char* fix;  // what makes it consistent
  std::function<Rigid3(const Rigid3&)> apply;
};

Rigid3 swapped_quaternion(const Rigid3& p) {
  // As read: w x y z of a file that has x y z w.
  const Eigen::Quaterniond& q = p.rotation;
  return {Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), p.translation};
}

Eigen::Vector3d enu_ned(const Eigen::Vector3d& v) { return {v.y(), v.x(), -v.z()}; }

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> all = {
      {"the quaternion columns hold x y z w: write them as q_w,q_x,q_y,q_z", swapped_quaternion},
      {"the quaternions are body_from_world: write their conjugates",
       [](const Rigid3& p) {
         return Rigid3{p.rotation.conjugate(), p.translation};
       }},
      {"the poses are body_from_world: write their inverses", [](const Rigid3& p) { return inverse(p); }},
      {"positions and attitudes are in different worlds (one is ENU, one NED): write the positions as y, x, "
       "-z",
       [](const Rigid3& p) {
         return Rigid3{p.rotation, enu_ned(p.translation)};
       }},
      {"positions and attitudes are in different worlds (height upwards, attitude NED): write the positions "
       "as "
       "x, y, -z",
       [](const Rigid3& p) {
         return Rigid3{p.rotation, Eigen::Vector3d(p.translation.x(), p.translation.y(), -p.translation.z())};
       }},
      {"x and y of the positions are swapped against the attitudes: write y, x, z",
       [](const Rigid3& p) {
         return Rigid3{p.rotation, Eigen::Vector3d(p.translation.y(), p.translation.x(), p.translation.z())};
       }},
      {"the positions are in mm: write m",
       [](const Rigid3& p) {
         return Rigid3{p.rotation, 1e-3 * p.translation};
       }},
      {"the positions are in feet: write m",
       [](const Rigid3& p) {
         return Rigid3{p.rotation, 0.3048 * p.translation};
       }},
      {"the positions are in cm: write m",
       [](const Rigid3& p) {
         return Rigid3{p.rotation, 0.01 * p.translation};
       }},
  };
  return all;
}

}  // namespace

std::string usual_mistake(const MountProblem& problem, const MountFlight& flight, const FlightStart& start) {
  // What fits to 1 deg and 3 cm in the middle is right.
  if (start.hand_eye.misfit < 1.5) return {};
  std::string best;
  double least = start.hand_eye.misfit / 3;  // much better, or it is none
  for (const Mistake& mistake : mistakes()) {
    for (const double near : {-0.1, 0.0, 0.1}) {
      auto pairs = hand_eye_pairs(problem, flight, start.trajectory, problem.nominal_offset + near, 150);
      for (HandEyePair& pair : pairs) pair.world_from_body = mistake.apply(pair.world_from_body);
      const HandEye eye = solve_hand_eye(pairs, problem.nominal_mount);
      if (eye.misfit < least) {
        least = eye.misfit;
        best = mistake.fix;
      }
    }
  }
  return best.empty() ? best
                      : "navigation is not world_from_body as recorded, but would fit if changed: " + best;
}

std::string explain_misfit(const MountProblem& problem, const MountFlight& flight, const FlightStart& start) {
  const std::string mistake = usual_mistake(problem, flight, start);
  if (!mistake.empty()) return mistake;
  return "no usual mistake of the recording explains it (quaternion order or direction, ENU against NED, "
         "units); "
         "if the clocks are further apart than " +
         std::to_string(static_cast<int>(std::lround(1000 * problem.options.offset_reach))) +
         " ms, say about how far with frames.time_offset";
}

}  // namespace perch
