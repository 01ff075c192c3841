#include "perch/pose/pose_estimator.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "perch/geometry/euler.h"
#include "perch/pose/calibration_covariance.h"
#include "perch/pose/linear_seed.h"
#include "perch/pose/planar_ambiguity.h"

namespace perch {
namespace {

// How much the stated sigmas count against the residuals when the noise is estimated, in degrees of freedom:
// four corners leave two residuals to spare, whose mean square alone would be worthless.
constexpr double kPriorFreedom = 8;

// A descent ends when the sum of squared sigmas falls by less: that moves no pose by more than a thousandth
// of its own deviation.
constexpr double kDone = 1e-6;
// In the neighbourhood of a minimum: from there Huber's loss takes over from least squares.
constexpr double kNear = 1;
// Of a second minimum the cost is asked for, against differences of units. One that costs less than
// kInQuestion (five sigma) more than the first may win and is finished; any other is a tenth of a sigma off.
constexpr double kRough = 0.01;
constexpr double kInQuestion = 25;

// The same of edges, as a part of the cost: that of the minimum is 2 in the mean, so no pose moves by more
// than one or two hundredths of its deviation; one that is out of question costs much, and need not be known.
constexpr double kPlaneDone = 1e-4;

// Minima whose rotations are closer than this are one. In the flat valley of a face seen from far and
// straight on a descent ends up to 6 % of a deviation (the fourth root of kDone) before the bottom.
constexpr double kSameMinimum = 0.01;  // rad

// A second minimum this near in the best one's own covariance (a chi-square; three sigma) is no other answer
// but the same one, badly known, as soon as a hint has had its say: then the nearer of the two to the hint is
// off by its noise.
constexpr double kSameWithinNoise = 9;

// Edges that no pose brings nearer than this are not those of one flat target: smeared ones, double, or half
// of them others. Those of targets are within 0.35 px at the worst noise, within 0.6 px without a lens
// model.
constexpr double kMostEdgeRms = 0.6;  // px

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::Vector3d normal_of(const Rigid3& camera_from_target) {
  return camera_from_target.rotation * Eigen::Vector3d::UnitZ();
}

bool faces_camera(const Rigid3& camera_from_target) {
  return normal_of(camera_from_target).dot(camera_from_target.translation) < 0;
}

// A hint that is none counts for nothing.
bool is_usable(const NormalHint& hint) {
  return hint.normal_in_camera.allFinite() && hint.normal_in_camera.norm() > 0 && std::isfinite(hint.sigma) &&
         hint.sigma > 0;
}

// The angle between a pose's normal and the hint's, squared, over the variance of both along it.
double chi_square(const UncertainRigid3& camera_from_target, const NormalHint& hint) {
  const Eigen::Vector3d normal = normal_of(camera_from_target.mean);
  const Eigen::Vector3d cross = normal.cross(hint.normal_in_camera);
  const double angle = std::atan2(cross.norm(), normal.dot(hint.normal_in_camera));
  // Normals that agree, or are opposite, have no one axis.
  const Eigen::Vector3d axis = cross.norm() > 0 ? cross.normalized() : normal.unitOrthogonal();
  const double own = axis.dot(camera_from_target.covariance.bottomRightCorner<3, 3>() * axis);
  return angle * angle / (hint.sigma * hint.sigma + own);
}

}  // namespace

PoseOptions read_pose_options(Section pose) {
  PoseOptions o;
  pose.read("max_rms_sigmas", o.max_rms_sigmas, kPositive);
  pose.read("max_misfit_px", o.max_misfit_px, kPositive);
  pose.read("huber_sigmas", o.huber_sigmas, kPositive);
  pose.read("min_evidence", o.min_evidence, kNotNegative);
  pose.read("gravity_sigma_deg", o.gravity_sigma_deg, kPositive);
  pose.read("same_minimum_deg", o.same_minimum_deg, kNotNegative);
  pose.read("calibration_uncertainty", o.calibration_uncertainty);
  pose.read("max_iterations", o.max_iterations, Range{1, 1000});
  pose.done();
  return o;
}

PoseEstimator::PoseEstimator(const LandingTarget& target, const CameraModel& camera,
                             const PoseOptions& options)
    : camera_(camera), options_(options), errors_(camera) {
  for (const auto& feature : target.features) {
    features_.push_back(feature.point);
    all_features_.push_back({{feature.point.x(), feature.point.y(), 0}, Eigen::Vector2d::Zero(), 1});
  }
  solver_.options.max_num_iterations = options.max_iterations;
  solver_.options.gradient_tolerance = 1e-9;
  plane_solver_.options.function_tolerance = kPlaneDone;
}

// The linear seed is the best from near, the infinitesimal poses from far: which one, the pixels tell.
std::optional<Rigid3> PoseEstimator::best_seed() {
  const auto view = plane_view(plane_, image_);
  if (!view) return std::nullopt;
  std::optional<Rigid3> best;
  double lowest = kInfinity;
  const auto consider = [&](const Rigid3& seed) {
    LossSum sum;
    const ReprojectionCost cost(errors_, seed, kInfinity);
    if (!cost.sum(PoseVector::Zero(), false, &sum) || !(sum.value < lowest)) return;
    best = seed;
    lowest = sum.value;
  };
  if (const auto seed = linear_seed(*view)) consider(*seed);
  if (const auto pair = infinitesimal_poses(*view)) std::ranges::for_each(*pair, consider);
  return best;
}

// By least squares (`huber` infinite) to the neighbourhood of a minimum: far from one all errors are beyond
// Huber's bound, and his loss takes four times the steps. Then by his loss to its bottom.
std::optional<PoseEstimator::Descent> PoseEstimator::descend(const Rigid3& start, double huber,
                                                             double tolerance) {
  const ReprojectionCost cost(errors_, start, huber);
  solver_.options.function_tolerance = tolerance;
  PoseVector x = PoseVector::Zero();
  const auto& summary = solver_.Solve(cost, &x);
  // The solver does not say that it could not evaluate the start; but then it has never set the gradient.
  if (summary.gradient_max_norm < 0 || !x.allFinite()) return std::nullopt;
  return Descent{cost.pose(x), summary.status != decltype(solver_)::HIT_MAX_ITERATIONS};
}

// The covariance is Huber's for his own estimate (Robust Statistics, 1981, 7.6): the mean of psi^2 over the
// square of the mean of psi', times (J'J)^-1. In two dimensions psi' is 1 along and across an error within
// the bound, beyond it 0 along and bound / distance across.
std::optional<PoseEstimator::Minimum> PoseEstimator::minimum_at(const Rigid3& camera_from_target) {
  Minimum minimum;
  minimum.camera_from_target.mean = camera_from_target;
  PoseCovariance information = PoseCovariance::Zero();
  double squares_px = 0, squares = 0, pull = 0, bend = 0;
  const auto errors = errors_.at(camera_from_target);
  if (errors.empty()) return std::nullopt;
  for (size_t i = 0; i < errors.size(); ++i) {
    const auto& [error, J] = errors[i];
    const double distance = error.norm(), bound = options_.huber_sigmas;
    squares += distance * distance;
    squares_px += std::pow(observations_[i].sigma_px * distance, 2);
    minimum.cost += huber_loss(distance, bound);
    pull += std::pow(std::min(distance, bound), 2);
    bend += distance <= bound ? 1 : 0.5 * bound / distance;
    information.noalias() += J.transpose() * J;
  }
  const auto n = static_cast<double>(observations_.size());
  const double freedom = std::max(0.0, 2 * n - 6);
  minimum.rms_px = std::sqrt(squares_px / n);
  minimum.rms_sigmas = std::sqrt(squares / n);
  minimum.variance = (kPriorFreedom + pull) / (kPriorFreedom + freedom);
  minimum.bend = bend / n;
  const Eigen::LDLT<PoseCovariance> ldlt(information);
  auto& covariance = minimum.camera_from_target.covariance;
  covariance = minimum.variance / (minimum.bend * minimum.bend) * ldlt.solve(PoseCovariance::Identity());
  if (!ldlt.isPositive() || !covariance.allFinite() || !std::isfinite(minimum.cost)) return std::nullopt;
  return minimum;
}

// Between one minimum and two lies a bent valley with one bottom, in which the mirror image may fit almost as
// well. Where the covariance, which knows of no bends, calls it impossible, it is in question too.
template <typename MinimumAt>
std::optional<PoseEstimator::Minimum> PoseEstimator::other_end_of_valley(const Minimum& best,
                                                                         const MinimumAt& at) const {
  const auto& [mean, covariance] = best.camera_from_target;
  const Rigid3 mirrored = mirrored_pose(mean);
  const Eigen::Vector3d turn = pose_error(mean, mirrored).tail<3>();
  const Eigen::Matrix3d of_turn = covariance.bottomRightCorner<3, 3>();
  if (!(turn.dot(of_turn.ldlt().solve(turn)) > options_.min_evidence)) return std::nullopt;
  return at(mirrored);
}

// The descent starts by least squares: far from a minimum all errors are beyond Huber's bound, and his loss
// takes four times the steps. A pose that fits so badly that it would be refused for itself is in no
// question, however far from the bottom of Huber's loss it may be.
std::optional<PoseEstimator::Minimum> PoseEstimator::second_minimum(const Minimum& best) {
  const Rigid3& first = best.camera_from_target.mean;
  const auto differs = [&](const std::optional<Descent>& descent) {
    return descent && faces_camera(descent->camera_from_target) &&
           descent->camera_from_target.rotation.angularDistance(first.rotation) > kSameMinimum;
  };
  const auto at_corners = [this](const Rigid3& pose) { return minimum_at(pose); };
  // A descent that has not come to its end is still a pose with its cost: it counts.
  const auto near = descend(mirrored_pose(first), kInfinity, kNear);
  if (!differs(near)) return other_end_of_valley(best, at_corners);
  const auto rough = minimum_at(near->camera_from_target);
  if (!rough || !(rough->rms_sigmas <= options_.max_rms_sigmas)) return rough;
  auto bottom = descend(near->camera_from_target, options_.huber_sigmas, kRough);
  if (!differs(bottom)) return other_end_of_valley(best, at_corners);
  const auto second = minimum_at(bottom->camera_from_target);
  if (!second || second->cost - best.cost > kInQuestion * best.variance / best.bend) return second;
  bottom = descend(bottom->camera_from_target, options_.huber_sigmas, kDone);
  return differs(bottom) ? minimum_at(bottom->camera_from_target) : other_end_of_valley(best, at_corners);
}

void PoseEstimator::observe(std::span<const Correspondence> correspondences) {
  observations_.clear();
  plane_.clear();
  image_.clear();
  for (const auto& c : correspondences) {
    // No measurement: nothing of it may reach the solver.
    if (c.feature < 0 || static_cast<size_t>(c.feature) >= features_.size()) continue;
    if (!std::isfinite(c.sigma_px) || !(c.sigma_px > 0)) continue;
    const Eigen::Vector2d& point = features_[static_cast<size_t>(c.feature)];
    const auto ray = camera_.ray_from_pixel(c.pixel);
    if (!ray || !(ray->z() > 0)) continue;  // outside the part of the picture the lens model covers
    observations_.push_back({{point.x(), point.y(), 0}, c.pixel, c.sigma_px});
    plane_.push_back(point);
    image_.push_back(ray->hnormalized());
  }
  errors_.observe(observations_);
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
  const auto seed = best_seed();
  if (!seed) return result;
  const auto near = descend(*seed, kInfinity, kNear);
  if (!near) return result;
  const auto descent = descend(near->camera_from_target, options_.huber_sigmas, kDone);
  if (!descent || !descent->converged) return result;
  std::optional<Minimum> best = minimum_at(descent->camera_from_target);
  if (!best) return result;
  decide(*best, second_minimum(*best), hints, result);
  add_calibration(observations_, result);
  return result;
}

// Takes the likelier of the two minima by their costs and the hints, or says that neither is.
void PoseEstimator::decide(Minimum best, std::optional<Minimum> second, std::span<const NormalHint> hints,
                           PoseResult& result) const {
  if (second && second->cost < best.cost) std::swap(best, *second);
  result.reprojection_rms_px = best.rms_px;
  if (second) result.ambiguity = second->cost > 0 ? best.cost / second->cost : 1;
  // Not "greater than": a NaN is refused too.
  const auto fits = [&](const Minimum& m) { return m.rms_sigmas <= options_.max_rms_sigmas; };
  if (!fits(best)) return;
  result.status = PoseStatus::kOk;
  result.camera_from_target = best.camera_from_target;
  if (!second || !fits(*second)) return;  // no alternative, whatever a hint may say

  double evidence = (second->cost - best.cost) * best.bend / best.variance;
  bool hinted = false;
  for (const auto& hint : hints) {
    if (!is_usable(hint)) continue;
    hinted = true;
    evidence += chi_square(second->camera_from_target, hint) - chi_square(best.camera_from_target, hint);
  }
  if (evidence < 0) std::swap(best, *second);
  result.reprojection_rms_px = best.rms_px;
  result.camera_from_target = best.camera_from_target;
  result.second = second->camera_from_target;
  // The covariance of the two as a mixture about the better one.
  const PoseError step = pose_error(best.camera_from_target.mean, second->camera_from_target.mean);
  const Eigen::Vector3d turn = step.tail<3>();
  const Eigen::Matrix3d of_turn = best.camera_from_target.covariance.bottomRightCorner<3, 3>();
  result.camera_from_target.covariance += step * step.transpose() / (1 + std::exp(std::abs(evidence) / 2));
  const bool decided = std::abs(evidence) >= options_.min_evidence;
  const bool harmless = turn.norm() < options_.same_minimum_deg * kRadFromDeg ||
                        (hinted && turn.dot(of_turn.ldlt().solve(turn)) < kSameWithinNoise);
  if (!decided && !harmless) result.status = PoseStatus::kAmbiguous;
}

// After the decision: a wrong lens is wrong at both minima alike and tells nothing of which is the right one.
void PoseEstimator::add_calibration(std::span<const Observation> observations, PoseResult& result) const {
  const bool posed = result.status == PoseStatus::kOk || result.status == PoseStatus::kAmbiguous;
  if (!posed || !options_.calibration_uncertainty) return;
  const auto add = [&](UncertainRigid3& pose) {
    pose.covariance += calibration_covariance(camera_, observations, pose.mean);
  };
  add(result.camera_from_target);
  if (result.second) add(*result.second);
}

// A minimum of the edges' distances.
std::optional<PoseEstimator::Minimum> PoseEstimator::descend(const WhitenedPlane& plane,
                                                             const Rigid3& start) {
  const PlaneCost cost(plane, start);
  PlaneCost::Parameters x = PlaneCost::Parameters::Zero();
  const auto& summary = plane_solver_.Solve(cost, &x);
  if (summary.gradient_max_norm < 0 || !x.allFinite() || !faces_camera(cost.pose(x))) return std::nullopt;
  return minimum_at(plane, cost.pose(x));
}

// What the homography fits better than any pose of a rigid target, two degrees of freedom, tells of the lens
// model, the print and the noise.
std::optional<PoseEstimator::Minimum> PoseEstimator::minimum_at(const WhitenedPlane& plane,
                                                                const Rigid3& camera_from_target) const {
  Minimum minimum;
  minimum.camera_from_target.mean = camera_from_target;
  PlaneStep residuals;
  PlaneCost::Jacobian J;
  const PlaneCost there(plane, camera_from_target);
  if (!there(PlaneCost::Parameters::Zero().eval().data(), residuals.data(), J.data())) return std::nullopt;
  minimum.cost = residuals.squaredNorm();
  minimum.variance = std::max(1.0, (kPriorFreedom + minimum.cost) / (kPriorFreedom + 2));
  const double misfit = std::sqrt(minimum.cost / std::max(1, plane.measured.edges)) * plane.measured.sigma_px;
  minimum.rms_px = std::hypot(plane.measured.rms_px, misfit);
  minimum.rms_sigmas = options_.max_rms_sigmas * misfit / options_.max_misfit_px;
  const PoseCovariance information = J.transpose().lazyProduct(J);
  const Eigen::LDLT<PoseCovariance> ldlt(information);
  auto& covariance = minimum.camera_from_target.covariance;
  covariance = minimum.variance * ldlt.solve(PoseCovariance::Identity());
  if (!ldlt.isPositive() || !covariance.allFinite() || !std::isfinite(minimum.cost)) return std::nullopt;
  return minimum;
}

PoseResult PoseEstimator::estimate(const PlaneMeasurement& measured, std::span<const NormalHint> hints,
                                   const Deformation& usual) {
  PoseResult result;
  const double per_px = step_per_px(measured, camera_);
  PlaneMeasurement softened = measured;
  softened.information = deformed(measured.information, usual.px2(), per_px);
  const WhitenedPlane plane(softened);
  result.features = measured.edges;
  // The linear seed where the perspective shows; else both poses of the first order.
  std::optional<Minimum> best, second;
  const auto consider = [&](const Rigid3& seed) {
    auto minimum = descend(plane, seed);
    if (!minimum) return;
    const auto apart = [&](const Minimum& other) {
      return other.camera_from_target.mean.rotation.angularDistance(
                 minimum->camera_from_target.mean.rotation) > kSameMinimum;
    };
    if (!best) {
      best = minimum;
    } else if (!apart(*best)) {
      if (minimum->cost < best->cost) best = minimum;
    } else if (!second || minimum->cost < second->cost) {
      second = minimum;
    }
  };
  const PlaneView view{measured.image_from_plane, Eigen::Vector2d::Zero()};
  if (const auto pair = infinitesimal_poses(view)) std::ranges::for_each(*pair, consider);
  if (!best || !second) {
    if (const auto seed = linear_seed(view)) consider(*seed);
  }
  if (!best) return result;
  if (!second)
    second = other_end_of_valley(*best, [&](const Rigid3& pose) { return minimum_at(plane, pose); });
  if (second && second->cost < best->cost) std::swap(best, second);
  result.deformation = usual;
  PlaneStep residuals;
  PlaneCost::Jacobian J;
  const PlaneCost there(plane, best->camera_from_target.mean);
  there(PlaneCost::Parameters::Zero().eval().data(), residuals.data(), J.data());
  learn(plane.root, J, residuals.squaredNorm(), per_px, result.deformation);
  if (result.deformation.px2() != usual.px2()) {
    softened.information = deformed(measured.information, result.deformation.px2(), per_px);
    const WhitenedPlane with_own(softened);
    for (auto* minimum : {&best, &second}) {
      if (*minimum) *minimum = minimum_at(with_own, (*minimum)->camera_from_target.mean);
    }
  }
  if (!best) return result;
  result.reprojection_rms_px = best->rms_px;
  // Not "greater than": a NaN is refused too.
  if (!(best->rms_px <= kMostEdgeRms)) return result;
  decide(*best, second, hints, result);
  add_calibration(all_features_, result);
  return result;
}

PoseResult PoseEstimator::estimate(const Detection& detection, std::span<const NormalHint> hints,
                                   const Deformation& usual) {
  return detection.plane ? estimate(*detection.plane, hints, usual)
                         : estimate(detection.correspondences, hints);
}

}  // namespace perch
