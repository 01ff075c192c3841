#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/camera/image_source.h"
#include "perch/estimator/run_config.h"

namespace perch {

// How a camera turned from one picture to the next: begin_from_end = Exp(turn), in its own axes.
struct CameraTurn {
  int64_t begin_ns = 0, end_ns = 0;                // camera clock
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  // rad
  double sigma = 0;                                // of each axis, rad
  bool by_target = false;                          // else by tracks of features
};

// Where both pictures show the landing target, by the estimator's poses, which no movement over the ground
// can be mistaken for a rotation in. Elsewhere, and where `config` is null, by features that are tracked from
// one picture to the next, as turn_by_tracks has it. Pairs that tell nothing are left out. `done` is called
// after each picture.
std::vector<CameraTurn> camera_turns(ImageSource& pictures, const CameraModel& camera,
                                     const RunConfig* config, const std::function<void()>& done);

// From what moves in the picture as one plane does, or as things far away do:
//
//   x_end ~ (R + t n' / d) x_begin,   R = end_from_begin
//
// A plane's picture has two such explanations; the one whose normal is nearer to the camera's axis is
// taken: a ground is looked at, not along. Empty where fewer than half of at least 30 features move so.
std::optional<Eigen::Vector3d> turn_by_tracks(const cv::Mat& begin, const cv::Mat& end,
                                              const CameraModel& camera);

}  // namespace perch
