#pragma once

#include <ceres/tiny_solver.h>

#include <optional>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/config/section.h"
#include "perch/detection/detector.h"
#include "perch/geometry/uncertainty.h"
#include "perch/pose/reprojection.h"
#include "perch/target/landing_target.h"

namespace perch {

enum class PoseStatus { kOk, kPartial, kAmbiguous, kRejected };

struct PoseOptions {
  // Root mean square distance of the corners, in units of their sigma: 1.4 is normal (two coordinates). More than
  // this is a wrong label or no target, not noise.
  double max_rms_sigmas = 4.0;
  // From here on a corner pulls with constant force (Huber), in sigmas: 95 % efficient on Gaussian noise at 1.345
  // for one coordinate; a little more as these are two.
  double huber_sigmas = 2.0;
  // By how much the cost of the second minimum must exceed that of the best, as a chi-square in the residuals' own
  // noise. 16 is four sigma: one wrong choice in 16,000.
  double min_evidence = 16;
  int max_iterations = 30;  // five is normal
};

// Reads the section and refuses unknown keys.
PoseOptions read_pose_options(Section pose);

struct PoseResult {
  PoseStatus status = PoseStatus::kRejected;
  UncertainRigid3 camera_from_target;     // meaningful with kOk, kAmbiguous
  std::optional<UncertainRigid3> second;  // the other minimum of the planar problem
  double reprojection_rms_px = 0;         // root of the mean squared distance over the features
  double ambiguity = 0;                   // cost of the best pose over that of the second: 0 sure, 1 undecidable
  int features = 0;
};

// From correspondences to the pose and its covariance: linear seed, refinement, both planar minima, decision.
// Holds its working memory: one estimator serves one thread. No result depends on an earlier call.
class PoseEstimator {
 public:
  PoseEstimator(const LandingTarget& target, const CameraModel& camera, const PoseOptions& options);

  // `prediction` decides between the two minima when the picture cannot.
  PoseResult estimate(std::span<const Correspondence> correspondences, const std::optional<Prediction>& prediction);

 private:
  struct Minimum {
    Rigid3 camera_from_target;
    double cost = 0;      // sum of the squared whitened errors, with the loss
    bool converged = false;
  };
  Minimum refine(const Rigid3& start);
  UncertainRigid3 with_covariance(const Minimum& minimum) const;
  double noise_variance(double cost) const;

  std::vector<Eigen::Vector2d> features_;
  CameraModel camera_;
  PoseOptions options_;
  std::vector<Observation> observations_;
  std::vector<Eigen::Vector2d> plane_, image_;
  ceres::TinySolver<ReprojectionCost> solver_;
};

}  // namespace perch
