#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "perch/camera/camera_model.h"
#include "perch/detection/detector.h"

namespace perch {

// What deforms a picture beyond the noise of its edges, and is the same for all of them: a rolling shutter,
// vibration during the exposure, an error of the lens model, a bent print. A mean square at the target's rim,
// the same for all eight numbers of a homography; two of them, by which it differs from the view of a rigid
// target, show it. They say little by themselves, so it is a mean over the frames so far: what deforms one
// goes on.
class Deformation {
 public:
  // As much of it as the frames show: what is less than the mean's own deviation is their noise.
  double px2() const { return std::max(mean_ - std::sqrt(variance_), 0.0); }

  // A frame's own estimate, without bias and so maybe below zero, its weight, and the deviation that noise
  // alone gives it.
  void add(double px2, double weight, double noise) {
    constexpr double kMemory = 16;  // frames
    weight_ = (1 - 1 / kMemory) * weight_ + weight;
    if (!(weight_ > 0)) return;
    const double part = weight / weight_;
    mean_ += part * (px2 - mean_);
    variance_ = (1 - part) * (1 - part) * variance_ + part * part * noise * noise;
  }

 private:
  double mean_ = 0, weight_ = 4e6, variance_ = 0;
};

// One px of such a deformation in units of a PlaneStep.
double step_per_px(const PlaneMeasurement& plane, const CameraModel& camera);

// The information that is left of a measurement's, (I^-1 + px2 step_per_px^2)^-1.
PlaneInformation deformed(const PlaneInformation& information, double px2, double step_per_px);

// What a pose's whitened residuals e (8) tell of it, J being their derivative (8x6) and `root` the root of
// the information that whitened them, under a deformation of `px2`: E e'e = 2 + (true - px2) trace(P M), P
// the projector on what J leaves over, M = root root' step_per_px^2.
void learn(const PlaneInformation& root, const Eigen::Matrix<double, 8, 6>& J, double squares,
           double step_per_px, Deformation& deformation);

}  // namespace perch
