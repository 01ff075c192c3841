#include "perch/pose/pose_estimator.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "perch/pose/linear_seed.h"
#include "perch/pose/planar_ambiguity.h"

namespace perch {
namespace {

// How much the stated sigmas count against the residuals when the noise is estimated, in degrees of freedom: four
// corners leave two residuals to spare, whose mean square alone would be worthless.
constexpr double kPriorFreedom = 8;

// Minima whose rotations are closer than this are one: the refinement stops a thousand times nearer.
constexpr double kSameMinimum = 1e-4;  // rad

}  // namespace

PoseOptions read_pose_options(Section pose) {
  PoseOptions o;
  pose.read("max_rms_sigmas", o.max_rms_sigmas, kPositive);
  pose.read("huber_sigmas", o.huber_sigmas, kPositive);
  pose.read("min_evidence", o.min_evidence, kNotNegative);
  pose.read("max_iterations", o.max_iterations, Range{1, 1000});
  pose.done();
  return o;
}

PoseEstimator::PoseEstimator(const LandingTarget& target, const CameraModel& camera, const PoseOptions& options)
    : camera_(camera), options_(options) {
  for (const auto& feature : target.features) features_.push_back(feature.point);
  solver_.options.max_num_iterations = options.max_iterations;
  // Of the whole cost: 1e-9 of a squared sigma moves no pose by a thousandth of its own deviation.
  solver_.options.function_tolerance = 1e-9;
  solver_.options.gradient_tolerance = 1e-9;
}

PoseEstimator::Minimum PoseEstimator::refine(const Rigid3& start) {
  const ReprojectionCost cost(camera_, observations_, start, options_.huber_sigmas);
  PoseVector x = PoseVector::Zero();
  Minimum minimum;
  // The solver does not ask whether its first evaluation succeeded.
  for (const auto& o : observations_) {
    if (!camera_.pixel_from_camera(start * o.p_target)) return minimum;
  }
  const auto& summary = solver_.Solve(cost, &x);
  minimum.camera_from_target = cost.pose(x);
  minimum.camera_from_target.rotation.normalize();
  minimum.cost = 2 * summary.final_cost;
  minimum.converged = std::isfinite(minimum.cost) && x.allFinite() &&
                      summary.status != decltype(solver_)::HIT_MAX_ITERATIONS;
  return minimum;
}

double PoseEstimator::noise_variance(double cost) const {
  const double freedom = std::max(0.0, 2.0 * static_cast<double>(observations_.size()) - 6);
  return (kPriorFreedom + cost) / (kPriorFreedom + freedom);
}

UncertainRigid3 PoseEstimator::with_covariance(const Minimum& minimum) const {
  PoseCovariance information = PoseCovariance::Zero();
  for (const auto& observation : observations_) {
    Eigen::Vector2d error;
    PixelJacobian J;
    if (!whitened_error(camera_, minimum.camera_from_target, observation, &error, &J)) continue;
    // A corner beyond Huber's bound holds the pose as weakly as it pulls.
    const double distance = error.norm();
    const double weight = distance > options_.huber_sigmas ? options_.huber_sigmas / distance : 1;
    information.noalias() += weight * J.transpose() * J;
  }
  const Eigen::LDLT<PoseCovariance> ldlt(information);
  UncertainRigid3 result{minimum.camera_from_target, PoseCovariance::Zero()};
  result.covariance = noise_variance(minimum.cost) * ldlt.solve(PoseCovariance::Identity());
  return result;
}

PoseResult PoseEstimator::estimate(std::span<const Correspondence> correspondences,
                                   const std::optional<Prediction>& prediction) {
  PoseResult result;
  result.features = static_cast<int>(correspondences.size());
  observations_.clear();
  plane_.clear();
  image_.clear();
  for (const auto& c : correspondences) {
    const Eigen::Vector2d& point = features_[static_cast<size_t>(c.feature)];
    const auto ray = camera_.ray_from_pixel(c.pixel);
    if (!ray || !(ray->z() > 0)) continue;  // outside the part of the picture the lens model covers
    observations_.push_back({{point.x(), point.y(), 0}, c.pixel, c.sigma_px});
    plane_.push_back(point);
    image_.push_back(ray->hnormalized());
  }
  if (observations_.size() < 4) {
    result.status = PoseStatus::kPartial;
    return result;
  }
  const auto seed = linear_seed(plane_, image_);
  if (!seed) return result;
  Minimum best = refine(*seed);
  if (!best.converged) return result;
  Minimum second = refine(mirrored_pose(best.camera_from_target));
  const double apart = second.camera_from_target.rotation.angularDistance(best.camera_from_target.rotation);
  const bool in_front =
      (second.camera_from_target.rotation * Eigen::Vector3d::UnitZ()).dot(second.camera_from_target.translation) < 0;
  const bool two = second.converged && apart > kSameMinimum && in_front;
  if (two && second.cost < best.cost) std::swap(best, second);

  const double noise = noise_variance(best.cost);
  double squares_px = 0;
  double squares = 0;
  for (const auto& o : observations_) {
    Eigen::Vector2d error = Eigen::Vector2d::Zero();
    whitened_error(camera_, best.camera_from_target, o, &error, nullptr);
    squares += error.squaredNorm();
    squares_px += (o.sigma_px * error).squaredNorm();
  }
  const double n = static_cast<double>(observations_.size());
  result.reprojection_rms_px = std::sqrt(squares_px / n);
  result.features = static_cast<int>(observations_.size());
  // Not "greater than": a NaN is refused too.
  if (!(std::sqrt(squares / n) <= options_.max_rms_sigmas)) return result;

  bool decided = true;
  if (two) {
    result.ambiguity = second.cost > 0 ? best.cost / second.cost : 1;
    decided = second.cost - best.cost >= options_.min_evidence * noise;
    if (!decided && prediction) {
      const auto& expected = prediction->camera_from_target.mean.rotation;
      const double of_best = best.camera_from_target.rotation.angularDistance(expected);
      const double of_second = second.camera_from_target.rotation.angularDistance(expected);
      // The nearer one must be nearer by a third of the way between the two: halfway the prediction says nothing.
      decided = std::abs(of_second - of_best) > apart / 3;
      if (decided && of_second < of_best) std::swap(best, second);
    }
    result.second = with_covariance(second);
  }
  result.camera_from_target = with_covariance(best);
  if (!result.camera_from_target.covariance.allFinite()) return result;
  result.status = decided ? PoseStatus::kOk : PoseStatus::kAmbiguous;
  return result;
}

}  // namespace perch
