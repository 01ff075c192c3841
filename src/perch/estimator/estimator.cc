#include "perch/estimator/estimator.h"

#include <cmath>

#include "perch/detection/stopwatch.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

EstimateStatus from_pose(PoseStatus status) {
  switch (status) {
    case PoseStatus::kOk:
      return EstimateStatus::kOk;
    case PoseStatus::kPartial:
      return EstimateStatus::kPartial;
    case PoseStatus::kAmbiguous:
      return EstimateStatus::kAmbiguous;
    case PoseStatus::kRejected:
      break;
  }
  return EstimateStatus::kRejected;
}

EstimateStatus from_detection(DetectionStatus status) {
  switch (status) {
    case DetectionStatus::kPartial:
      return EstimateStatus::kPartial;
    case DetectionStatus::kAmbiguous:
      return EstimateStatus::kAmbiguous;
    default:
      return EstimateStatus::kNoTarget;
  }
}

// Why this frame cannot be estimated; empty when it can.
std::string unreadable(const Frame& frame, const CameraModel& camera) {
  if (!frame.problem.empty()) return frame.problem;
  const auto size = [](int width, int height) {
    return std::to_string(width) + "x" + std::to_string(height);
  };
  if (frame.grey.cols != camera.width() || frame.grey.rows != camera.height()) {
    return frame.name + ": expected a picture of the camera model's " +
           size(camera.width(), camera.height()) + " pixels, found " + size(frame.grey.cols, frame.grey.rows);
  }
  if (frame.grey.type() != CV_8UC1) return frame.name + ": expected 8 bits of grey a pixel";
  return {};
}

// The normal that the poses before lead to expect. The covariance of a chain of poses does not know that an
// earlier one may have been the wrong minimum: five degrees more keep it from outvoting gravity.
NormalHint from_prediction(const Prediction& prediction) {
  const auto& [mean, covariance] = prediction.camera_from_target;
  const double floor = 5 * kRadFromDeg;
  const double variance = covariance.bottomRightCorner<3, 3>().diagonal().maxCoeff();
  return {mean.rotation * Eigen::Vector3d::UnitZ(), std::sqrt(variance + floor * floor)};
}

}  // namespace

const char* to_string(EstimateStatus status) {
  switch (status) {
    case EstimateStatus::kOk:
      return "ok";
    case EstimateStatus::kNoTarget:
      return "no_target";
    case EstimateStatus::kPartial:
      return "partial";
    case EstimateStatus::kAmbiguous:
      return "ambiguous";
    case EstimateStatus::kRejected:
      return "rejected";
    case EstimateStatus::kUnreadable:
      break;
  }
  return "unreadable";
}

Estimator::Estimator(const RunConfig& config, const CameraModel& camera)
    : config_(config),
      camera_(camera),
      frames_(config.frames),
      gravity_sigma_(config.pose.gravity_sigma_deg * kRadFromDeg),
      follow_(config.detection.follow),
      detector_(make_detector(config.target, camera, config.detection)),
      pose_(config.target, camera, config.pose),
      filter_(config.tracking) {}

// Another zoom is another lens, for everything that holds one. What is wrong with the zoom; empty: nothing.
std::string Estimator::zoom_to(const std::optional<double>& zoom) {
  if (!config_.zoom_table || (zoom && zoom == zoom_)) return {};
  if (!zoom) return "nothing tells the zoom, and camera.zoom_table needs it";
  const auto camera = config_.zoom_table->at(*zoom);
  if (!camera) return "zoom " + std::to_string(*zoom) + ": beyond what the zoom table was calibrated for";
  camera_ = *camera;
  detector_ = make_detector(config_.target, camera_, config_.detection);
  pose_ = PoseEstimator(config_.target, camera_, config_.pose);
  zoom_ = zoom;
  return {};
}

std::optional<Prediction> Estimator::predict(int64_t timestamp_ns,
                                             const std::optional<HeadAngles>& angles) const {
  const auto state = filter_.predict_widely(timestamp_ns);
  if (!state || !knows_camera(frames_, angles)) return std::nullopt;
  return Prediction{camera_from_target_of(
      frames_, {state->pad_from_body, state->covariance.topLeftCorner<6, 6>()}, angles)};
}

void Estimator::estimate_pose(const Frame& frame, const Aid& aid, Estimate& estimate) {
  estimate.problem = unreadable(frame, camera_);
  if (estimate.problem.empty()) estimate.problem = zoom_to(aid.zoom);
  if (!estimate.problem.empty()) {
    estimate.status = EstimateStatus::kUnreadable;
    return;
  }
  Stopwatch stopwatch(estimate.stages);
  auto prediction = predict(frame.timestamp_ns, aid.angles);
  if (prediction) prediction->blur_px = blur_px_;
  const Detection& detection = detector_->detect(frame.grey, follow_ ? prediction : std::nullopt);
  estimate.detect_us = stopwatch.since_lap_us();
  estimate.stages = detection.stages;
  estimate.correspondences = detection.correspondences;
  estimate.residuals = detection.residuals;
  estimate.threshold = detection.threshold;
  estimate.features = static_cast<int>(detection.correspondences.size());
  if (detection.status != DetectionStatus::kFound) {
    estimate.status = from_detection(detection.status);
    return;
  }
  stopwatch.restart();
  std::vector<NormalHint> hints;
  if (prediction) hints.push_back(from_prediction(*prediction));
  if (aid.world_from_body && knows_camera(frames_, aid.angles)) {
    const auto normal = level_normal_in_camera(frames_, *aid.world_from_body, aid.angles);
    if (normal) hints.push_back({*normal, gravity_sigma_});
  }
  const PoseResult pose = pose_.estimate(detection, hints, deformation_);
  stopwatch.lap("pose");
  estimate.pose_us = estimate.stages.back().us;
  estimate.status = from_pose(pose.status);
  estimate.reprojection_rms_px = pose.reprojection_rms_px;
  estimate.ambiguity = pose.ambiguity;
  estimate.features = pose.features;
  if (estimate.status != EstimateStatus::kOk) return;
  deformation_ = pose.deformation;
  blur_px_ = detection.plane ? detection.plane->blur_px : 0;
  estimate.camera_from_target = pose.camera_from_target;
  if (knows_camera(frames_, aid.angles))
    estimate.pad_from_body = pad_from_body_by_vision(frames_, pose.camera_from_target, aid.angles);
  stopwatch.lap("frames");
}

Estimate Estimator::process(const Frame& frame, const Aid& aid) {
  Estimate estimate;
  estimate.timestamp_ns = frame.timestamp_ns;
  std::vector<StageTime> total;
  Stopwatch whole(total);
  for (const AutopilotSample& sample : aid.autopilot) filter_.hear(sample);
  estimate_pose(frame, aid, estimate);
  Stopwatch stopwatch(estimate.stages);
  estimate.state = filter_.update(frame.timestamp_ns, estimate.pad_from_body);
  stopwatch.lap("tracking");
  estimate.total_us = whole.since_lap_us();
  return estimate;
}

}  // namespace perch
