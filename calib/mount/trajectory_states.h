#pragma once

#include <ceres/problem.h>

#include <deque>
#include <map>
#include <span>

#include "calib/mount/sight_cost.h"

namespace perch {

// The corrections of a flight's trajectory as states of the least squares: truth = perturb(navigation, c).
//
//   smooth trajectory   c(t) = u(t) - b(t), u linear between states a tenth of a second apart, each measured
//                       by the navigation's samples about the curve
//   joined samples      c = u - b with one u a picture, of the samples' own noise
//   b                   the drift, Ornstein-Uhlenbeck through the same states; absent where there is none
class TrajectoryStates {
 public:
  // `camera_ns`: of the pictures that are used, ascending.
  TrajectoryStates(const Trajectory& trajectory, const NavigationNoise& noise,
                   std::span<const int64_t> camera_ns, double offset);

  void add_priors(ceres::Problem& problem);
  std::vector<CorrectionPart> parts(size_t picture);

 private:
  struct Node {
    double time = 0;  // s after the first picture
    Vector6d measured = Vector6d::Zero(), drift = Vector6d::Zero();
  };
  struct Place {
    Node* a = nullptr;
    Node* b = nullptr;  // null: a alone
    double s = 0;       // of the way from a to b
    double noise_part = 1;
  };
  void add_samples(ceres::Problem& problem, const Place& place, int64_t cell) const;

  const Trajectory& trajectory_;
  NavigationNoise noise_;
  bool drifts_;
  int64_t start_ns_ = 0;           // of cell 0, navigation clock
  double spacing_ = 0.1;           // s
  std::map<int64_t, Node> nodes_;  // addresses stay
  std::vector<Place> places_;
  std::vector<int64_t> cells_;
};

}  // namespace perch
