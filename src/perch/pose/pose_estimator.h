#pragma once

#include <optional>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/config/section.h"
#include "perch/detection/detector.h"
#include "perch/geometry/uncertainty.h"
#include "perch/pose/deformation.h"
#include "perch/pose/plane_cost.h"
#include "perch/pose/reprojection.h"
#include "perch/target/landing_target.h"

namespace perch {

enum class PoseStatus { kOk, kPartial, kAmbiguous, kRejected };

struct PoseOptions {
  // Root mean square distance of the corners, in units of their sigma: 1.4 is normal (two coordinates). More
  // than this is a wrong label or no target, not noise.
  double max_rms_sigmas = 4.0;
  // The same of edges: how far off the homography that they fit a rigid target seen through this camera model
  // may be. Beyond it the target is bent or the camera model wrong.
  double max_misfit_px = 1.5;
  // From here on a corner pulls with constant force (Huber), in sigmas: 95 % efficient on Gaussian noise
  // at 1.345 for one coordinate; a little more as these are two.
  double huber_sigmas = 2.0;
  // By how much the chosen minimum must be the likelier, as a difference of chi-squares: the residuals' in
  // their own noise, and the angles' between the face's normal and each hint. 6 is two and a half sigma;
  // 9 would be three, and cost the integer corners of `paper` another twentieth of a descent from 9 m.
  double min_evidence = 6;
  // How well gravity tells the face's normal: the autopilot's attitude (1 deg), the mount and how level the
  // pad is.
  double gravity_sigma_deg = 3;
  // Minima closer than this are not worth a word: the covariance takes both in.
  double same_minimum_deg = 5;
  // Whether the covariance takes in how well the camera is calibrated, of a model that says so.
  bool calibration_uncertainty = true;
  int max_iterations = 50;  // five are normal; in the flat valley of a face seen straight on, 30
};

// Reads the section and refuses unknown keys.
PoseOptions read_pose_options(Section pose);

// Where the face's normal points, from something else than the picture: gravity, or the poses before.
struct NormalHint {
  Eigen::Vector3d normal_in_camera = Eigen::Vector3d::Zero();  // unit
  double sigma = 1;                                            // rad
};

struct PoseResult {
  PoseStatus status = PoseStatus::kRejected;
  UncertainRigid3 camera_from_target;  // meaningful with kOk, kAmbiguous
  // The other pose of the planar problem, where it is in question: the second minimum, or the mirror image of
  // the first when that is no minimum but fits as well.
  std::optional<UncertainRigid3> second;
  double reprojection_rms_px = 0;  // root of the mean squared distance over the features
  double ambiguity = 0;            // cost of the best pose over that of the second: 0 sure, 1 undecidable
  int features = 0;
  Deformation deformation;  // of edges: of the frames before and this one
};

// From correspondences to the pose and its covariance: linear seed, refinement, both planar minima, decision.
// Holds its working memory: one estimator serves one thread. No result depends on an earlier call.
class PoseEstimator {
 public:
  PoseEstimator(const LandingTarget& target, const CameraModel& camera, const PoseOptions& options);

  // `hints` help to decide between the two minima; they do not move either.
  PoseResult estimate(std::span<const Correspondence> correspondences,
                      std::span<const NormalHint> hints = {});
  // The same from the edges that a homography stands for; `usual`: of the frames before.
  PoseResult estimate(const PlaneMeasurement& plane, std::span<const NormalHint> hints = {},
                      const Deformation& usual = {});
  // By the better of what the detector has measured.
  PoseResult estimate(const Detection& detection, std::span<const NormalHint> hints = {},
                      const Deformation& usual = {});

 private:
  struct Descent {
    Rigid3 camera_from_target;
    bool converged = false;
  };
  // A pose with what its residuals tell. Huber's loss is rho(d) of a whitened distance d, psi half its slope.
  struct Minimum {
    UncertainRigid3 camera_from_target;
    double cost = 0;                    // sum of rho
    double rms_px = 0, rms_sigmas = 0;  // root mean squared distance
    double variance = 1;                // of the noise in stated ones: psi^2 a degree of freedom
    double bend = 1;                    // mean of psi', 1 when no error is beyond the bound
  };
  std::optional<Minimum> descend(const WhitenedPlane& plane, const Rigid3& start);
  void decide(Minimum best, std::optional<Minimum> second, std::span<const NormalHint> hints,
              PoseResult& result) const;
  void add_calibration(std::span<const Observation> observations, PoseResult& result) const;
  void observe(std::span<const Correspondence> correspondences);
  std::optional<Rigid3> best_seed();
  std::optional<Descent> descend(const Rigid3& start, double huber, double tolerance);
  std::optional<Minimum> minimum_at(const Rigid3& camera_from_target);
  std::optional<Minimum> second_minimum(const Minimum& best);
  std::optional<Minimum> minimum_at(const WhitenedPlane& plane, const Rigid3& camera_from_target) const;
  template <typename MinimumAt>
  std::optional<Minimum> other_end_of_valley(const Minimum& best, const MinimumAt& at) const;

  std::vector<Eigen::Vector2d> features_;
  std::vector<Observation> all_features_;  // of edges: their places alone
  CameraModel camera_;
  PoseOptions options_;
  std::vector<Observation> observations_;
  std::vector<Eigen::Vector2d> plane_, image_;
  ReprojectionErrors errors_;
  PoseSolver solver_;  // keeps nothing from one descent to the next
  PlaneSolver plane_solver_;
};

}  // namespace perch
