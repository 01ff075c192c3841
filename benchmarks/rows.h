#pragma once

#include <benchmark/benchmark.h>

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "perch/detection/detector.h"
#include "perch/geometry/rigid3.h"
#include "perch/pose/pose_estimator.h"

namespace perch {

// A picture and the truth about it.
struct Shot {
  cv::Mat grey;
  Rigid3 camera_from_target;
  std::optional<Prediction> prediction = {};  // where a detector that follows expects the target
};

// From a picture to camera_from_target, empty when it finds none. What is timed.
using FindPose = std::function<std::optional<Rigid3>(const Shot&)>;

// One row: the mean time a picture, and beside it how good the answers are: err_mm and err_mrad, means over
// the pictures in which the target was found, and the fraction found. A fast wrong answer shows.
void time_poses(benchmark::State& state, std::span<const Shot> shots, const FindPose& find_pose);

// A Detector and the PoseEstimator after it: the whole frame, from the picture to pose and covariance.
FindPose find_by(Detector& detector, PoseEstimator& estimator);

// The pose where there is one: an ambiguous pose is an answer too, and counts with its error.
std::optional<Rigid3> answer(const PoseResult& result);

}  // namespace perch
