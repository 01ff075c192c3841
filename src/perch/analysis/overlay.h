#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/estimator/estimate.h"
#include "perch/target/landing_target.h"

namespace perch {

struct OverlayOptions {
  int width_px = 480;     // of the result, at most; never wider than the picture
  double margin = 0.12;   // round the target, of its extent in the picture
  int jpeg_quality = 82;  // 25 to 40 kB a picture: tens of them make no report heavy
};

// Where the target's outlines are in the picture: one line a patch, closed, sampled so densely that a bent
// edge of a distorting lens looks bent. A line that leaves what the camera sees is cut into pieces. Pixels.
std::vector<std::vector<Eigen::Vector2d>> projected_outlines(const LandingTarget& target,
                                                             const CameraModel& camera,
                                                             const Rigid3& camera_from_target);

// A picture for people: the outlines at the recovered pose, the features' names, the measured points; cropped
// about the target. Without a pose: the whole picture with what was measured. `grey` is CV_8UC1, not empty;
// the result CV_8UC3, BGR. `camera` may be null: then no outline.
cv::Mat draw_overlay(const cv::Mat& grey, const LandingTarget& target, const CameraModel* camera,
                     const Estimate& estimate, const OverlayOptions& options = {});

// The same as JPEG bytes.
std::vector<unsigned char> overlay_jpeg(const cv::Mat& grey, const LandingTarget& target,
                                        const CameraModel* camera, const Estimate& estimate,
                                        const OverlayOptions& options = {});

}  // namespace perch
