#pragma once

#include <array>
#include <vector>

#include "perch/tracking/motion.h"

namespace perch {

// How lively the body and the pad are, nobody knows beforehand: a hover in still air and a landing in gusts,
// a lawn and a ship's deck. So several filters run side by side, one for each pair of a body's and a pad's
// noise, and each speaks by its probability (multiple model adaptive estimation, Magill 1965, with
// forgetting):
//
//   L_i' = -L_i / memory,   L_i += news * log N(y; 0, S_i) at each measurement,
//   mean = sum e^L_i x_i / sum e^L_i,   covariance = sum e^L_i (P_i + (x_i - mean)(x_i - mean)') / sum e^L_i.
//
// What they do not agree on is thus in the covariance. One that is surprised beyond the gate by what another
// one expected is wrong, and goes on from that other one's state.
class MotionBank {
 public:
  // Before the world is known pads make no difference, and there is one filter for each body only.
  MotionBank(std::vector<BodyNoise> bodies, std::vector<PadNoise> pads);

  void start(const Motion& motion);
  void propagate(double dt);
  // A measured pose: whether any filter believed it, its innovation squared within the gate (chi-square, 6
  // degrees of freedom). What none believes changes nothing.
  bool see(const UncertainRigid3& pad_from_body, double gate);
  // How much such a pose would surprise all of them together: its innovation squared.
  double surprise(const UncertainRigid3& pad_from_body) const;
  // A sample of the autopilot, each part gated for itself. After `patience` refusals in a row the world is
  // not what it was (the autopilot's heading was reset, say), and is met anew a second later: an autopilot
  // that makes no sense is not listened to at each of its words.
  void hear(const AutopilotSample& sample, double gate, int patience);

  // What all of them say together after dt, without the world.
  Motion predicted(double dt) const;
  // By the first hypothesis, whatever the others say.
  Motion predicted_by_first(double dt) const { return members_.front().predicted(dt); }

 private:
  struct Member {
    BodyNoise body;
    PadNoise pad;
    Motion motion;
    double log_likelihood = 0;  // less that of the best

    Motion predicted(double dt) const;
  };
  static bool less_likely(const Member& a, const Member& b) { return a.log_likelihood < b.log_likelihood; }
  template <typename InnovationOf>
  bool take(const InnovationOf& innovation_of, double gate, double news);
  double news_of_motion() const;
  void meet_world(const AutopilotSample& sample);
  void forget_world();

  std::vector<BodyNoise> bodies_;
  std::vector<PadNoise> pads_;
  std::vector<Member> members_;
  double deaf_ = 0;               // s, still
  double tracked_ = 0;            // s, since the start
  std::array<int, 3> refused_{};  // attitudes, velocities and angular velocities, in a row
};

}  // namespace perch
