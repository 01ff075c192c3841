#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/camera/image_source.h"
#include "perch/estimator/estimate.h"
#include "perch/estimator/run_config.h"

namespace perch {

// The way a picture takes, and nothing else:
//
//   Frame --detection--> Correspondences --pose--> camera_from_target --frames--> pad_from_body --tracking-->
//   state
//
// One frame in, one result out, in the order of the frames. Deterministic: the same frames give the same
// results, bit for bit but for the measured times. One Estimator serves one thread and allocates its buffers
// once.
class Estimator {
 public:
  // Of a zoom camera `camera` gives the pictures' size alone: each frame's zoom chooses the model. Throws
  // std::invalid_argument when the configured method cannot serve the target.
  Estimator(const RunConfig& config, const CameraModel& camera);

  // What is known besides the picture at the frame's time: the angles of the pan/tilt head, and the attitude
  // (the rotation of world_from_body), by which gravity decides what the picture of a plane cannot. And all
  // that the autopilot said since the last frame, in any order, for the filter.
  struct Aid {
    std::optional<HeadAngles> angles;
    std::optional<Eigen::Quaterniond> world_from_body;
    std::vector<AutopilotSample> autopilot;
    std::optional<double> zoom;  // in the zoom table's unit
  };
  Estimate process(const Frame& frame, const Aid& aid = {});

 private:
  void estimate_pose(const Frame& frame, const Aid& aid, Estimate& estimate);
  std::optional<Prediction> predict(int64_t timestamp_ns, const std::optional<HeadAngles>& angles) const;

  std::string zoom_to(const std::optional<double>& zoom);

  RunConfig config_;
  CameraModel camera_;
  std::optional<double> zoom_;  // that camera_ is of
  FrameChain frames_;
  double gravity_sigma_;  // rad
  bool follow_;
  std::unique_ptr<Detector> detector_;
  PoseEstimator pose_;
  Deformation deformation_;
  double blur_px_ = 0;  // of the last frame that showed the target; 0: unknown
  VehicleFilter filter_;
};

}  // namespace perch
