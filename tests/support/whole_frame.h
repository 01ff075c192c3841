#pragma once

#include <memory>
#include <string>

#include "perch/estimator/estimator.h"

namespace perch {

// What is needed to hold the whole frame, from the picture to the estimate, against the truth, whatever the
// method of detection.

// The methods that are held against it: a new one is added here.
inline const std::string kMethods[] = {"paper", "edges"};

// A run with defaults but for `method`, of a target of configs/targets.
inline RunConfig run_config_of(const std::string& method, const std::string& target = "sharp") {
  const std::string text = "{target: targets/" + target + ".yaml, detection: {method: " + method + "}}";
  return read_run_config(Section::parse(text, PERCH_SOURCE_DIR "/configs/run.yaml"));
}

// The detector of such a run, for those who want to give it predictions of their own.
inline std::unique_ptr<Detector> detector_of(const RunConfig& config, const CameraModel& camera) {
  return make_detector(config.target, camera, config.detection);
}

// The attitude of a vehicle whose body is the camera, over a level pad that it sees so.
inline Estimator::Aid level_pad(const Rigid3& camera_from_target) {
  Estimator::Aid aid;
  aid.world_from_body = camera_from_target.rotation.conjugate();
  return aid;
}

// The frame `number` of pictures that have nothing to do with each other: ten seconds apart, so that the
// estimator expects nothing from those before.
inline Frame lone_frame(int number, const cv::Mat& grey) {
  return {number * int64_t{10'000'000'000}, grey, "picture " + std::to_string(number), {}, ""};
}

}  // namespace perch
