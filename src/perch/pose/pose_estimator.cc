#include "perch/pose/pose_estimator.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "perch/geometry/euler.h"
#include "perch/pose/linear_seed.h"
#include "perch/pose/planar_ambiguity.h"

namespace perch {
namespace {

// How much the stated sigmas count against the residuals when the noise is estimated, in degrees of freedom:
// four corners leave two residuals to spare, whose mean square alone would be worthless.
constexpr double kPriorFreedom = 8;

// Minima whose rotations are closer than this are one: the refinement stops a thousand times nearer.
constexpr double kSameMinimum = 1e-4;  // rad

bool faces_camera(const Rigid3& camera_from_target) {
  return (camera_from_target.rotation * Eigen::Vector3d::UnitZ()).dot(camera_from_target.translation) < 0;
}

}  // namespace

PoseOptions read_pose_options(Section pose) {
  PoseOptions o;
  pose.read("max_rms_sigmas", o.max_rms_sigmas, kPositive);
  pose.read("huber_sigmas", o.huber_sigmas, kPositive);
  pose.read("min_evidence", o.min_evidence, kNotNegative);
  pose.read("gravity_sigma_deg", o.gravity_sigma_deg, kPositive);
  pose.read("same_minimum_deg", o.same_minimum_deg, kNotNegative);
  pose.read("max_iterations", o.max_iterations, Range{1, 1000});
  pose.done();
  return o;
}

PoseEstimator::PoseEstimator(const LandingTarget& target, const CameraModel& camera,
                             const PoseOptions& options)
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
  minimum.converged =
      std::isfinite(minimum.cost) && x.allFinite() && summary.status != decltype(solver_)::HIT_MAX_ITERATIONS;
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

void PoseEstimator::observe(std::span<const Correspondence> correspondences) {
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
}

PoseEstimator::Residuals PoseEstimator::residuals_at(const Rigid3& camera_from_target) const {
  double squares_px = 0;
  double squares = 0;
  for (const auto& o : observations_) {
    Eigen::Vector2d error = Eigen::Vector2d::Zero();
    whitened_error(camera_, camera_from_target, o, &error, nullptr);
    squares += error.squaredNorm();
    squares_px += (o.sigma_px * error).squaredNorm();
  }
  const double n = static_cast<double>(observations_.size());
  return {std::sqrt(squares_px / n), std::sqrt(squares / n)};
}

double PoseEstimator::chi_square(const Minimum& minimum, double noise,
                                 std::span<const NormalHint> hints) const {
  double sum = minimum.cost / noise;
  const Eigen::Vector3d normal = minimum.camera_from_target.rotation * Eigen::Vector3d::UnitZ();
  for (const auto& hint : hints) {
    const double angle =
        std::atan2(normal.cross(hint.normal_in_camera).norm(), normal.dot(hint.normal_in_camera));
    sum += angle * angle / (hint.sigma * hint.sigma);
  }
  return sum;
}

PoseResult PoseEstimator::estimate(std::span<const Correspondence> correspondences,
                                   std::span<const NormalHint> hints) {
  PoseResult result;
  observe(correspondences);
  result.features = static_cast<int>(observations_.size());
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
  const bool two = second.converged && apart > kSameMinimum && faces_camera(second.camera_from_target);
  const double noise = noise_variance(two ? std::min(best.cost, second.cost) : best.cost);
  double evidence = std::numeric_limits<double>::infinity();
  if (two) {
    result.ambiguity = std::min(best.cost, second.cost) / std::max(best.cost, second.cost);
    evidence = chi_square(second, noise, hints) - chi_square(best, noise, hints);
    if (evidence < 0) std::swap(best, second);
    evidence = std::abs(evidence);
    result.second = with_covariance(second);
  }

  const Residuals residuals = residuals_at(best.camera_from_target);
  result.reprojection_rms_px = residuals.rms_px;
  // Not "greater than": a NaN is refused too.
  if (!(residuals.rms_sigmas <= options_.max_rms_sigmas)) return result;
  result.camera_from_target = with_covariance(best);
  const bool decided = evidence >= options_.min_evidence;
  if (two) {
    // The covariance of the two as a mixture about the better one.
    const PoseError step = pose_error(best.camera_from_target, second.camera_from_target);
    result.camera_from_target.covariance += step * step.transpose() / (1 + std::exp(evidence / 2));
  }
  if (!result.camera_from_target.covariance.allFinite()) return result;
  const bool harmless = apart < options_.same_minimum_deg * kRadFromDeg;
  result.status = decided || harmless ? PoseStatus::kOk : PoseStatus::kAmbiguous;
  return result;
}

}  // namespace perch
