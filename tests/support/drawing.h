#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/detection/detector.h"
#include "perch/geometry/rigid3.h"
#include "perch/target/landing_target.h"
#include "support/rng.h"

namespace perch {

// Grey levels and faults of a drawn picture.
struct Drawing {
  int ground = 40, black = 20, white = 220;
  double blur_px = 0.5;   // sigma of a lens in focus
  double noise = 0;       // sigma, grey levels
  std::vector<int> skip;  // indices of LandingTarget::patches to leave out
};

// Where a point of the target is seen; no test looks from behind.
inline Eigen::Vector2d seen_at(const CameraModel& camera, const Rigid3& camera_from_target,
                               const Eigen::Vector2d& point) {
  return camera.pixel_from_camera(camera_from_target * Eigen::Vector3d(point.x(), point.y(), 0)).value();
}

// Paints the target into the picture as polygons with straight sides (so without much lens distortion), each
// pixel by its covered area to 1/255: OpenCV's anti-aliasing is a box of one pixel.
inline void draw_target(cv::Mat& grey, const LandingTarget& target, const CameraModel& camera,
                        const Rigid3& camera_from_target, const Drawing& drawing = {}) {
  constexpr int kFine = 4;  // drawn larger by this and averaged: exact to 1/16 of a pixel's area, 0.06 px
  cv::Mat fine(grey.rows * kFine, grey.cols * kFine, CV_8UC1);
  cv::resize(grey, fine, fine.size(), 0, 0, cv::INTER_NEAREST);
  constexpr int kShift = 4;
  for (size_t i = 0; i < target.patches.size(); ++i) {
    if (std::count(drawing.skip.begin(), drawing.skip.end(), static_cast<int>(i)) > 0) continue;
    const Patch& patch = target.patches[i];
    std::vector<cv::Point> polygon;
    for (const auto& corner : patch.corners) {
      // The centre of pixel x is that of the fine pixels kFine x .. kFine x + kFine - 1.
      const Eigen::Vector2d p =
          kFine * seen_at(camera, camera_from_target, corner) + Eigen::Vector2d::Constant(0.5 * (kFine - 1));
      polygon.emplace_back(static_cast<int>(std::lround(p.x() * (1 << kShift))),
                           static_cast<int>(std::lround(p.y() * (1 << kShift))));
    }
    cv::fillConvexPoly(fine, polygon, cv::Scalar(patch.white ? drawing.white : drawing.black), cv::LINE_8,
                       kShift);
  }
  cv::resize(fine, grey, grey.size(), 0, 0, cv::INTER_AREA);
}

// The target alone on even ground, as a camera of this size sees it.
inline cv::Mat picture_of(const LandingTarget& target, const CameraModel& camera,
                          const Rigid3& camera_from_target, const Drawing& drawing = {},
                          TestRng* rng = nullptr) {
  cv::Mat grey(camera.height(), camera.width(), CV_8UC1, cv::Scalar(drawing.ground));
  draw_target(grey, target, camera, camera_from_target, drawing);
  if (drawing.blur_px > 0) cv::GaussianBlur(grey, grey, {}, drawing.blur_px);
  if (rng && drawing.noise > 0) {
    // A prime number of values over and over: drawing millions of them anew would take longer than all else.
    std::vector<double> noise(10007);
    for (auto& n : noise) n = rng->normal(drawing.noise);
    size_t next = 0;
    for (int y = 0; y < grey.rows; ++y) {
      for (int x = 0; x < grey.cols; ++x) {
        auto& pixel = grey.at<uint8_t>(y, x);
        pixel = cv::saturate_cast<uint8_t>(pixel + noise[next++ % noise.size()]);
      }
    }
  }
  return grey;
}

// The largest distance of a measured feature from where it is; infinite when not all are measured.
inline double worst_corner_px(const Detection& detection, const LandingTarget& target,
                              const CameraModel& camera, const Rigid3& camera_from_target) {
  double worst = 0;
  for (const auto& c : detection.correspondences) {
    const Eigen::Vector2d& point = target.features[static_cast<size_t>(c.feature)].point;
    worst = std::max(worst, (c.pixel - seen_at(camera, camera_from_target, point)).norm());
  }
  return detection.correspondences.size() < 24 ? INFINITY : worst;
}

// A pose that looks at the target's centre from `distance`, tilted about an axis in the picture plane at
// `towards`, turned by `yaw` about its normal, its centre `off` from the optical axis.
inline Rigid3 looking_pose(double distance, double tilt, double towards, double yaw,
                           const Eigen::Vector2d& off = Eigen::Vector2d::Zero()) {
  const Eigen::AngleAxisd facing(M_PI, Eigen::Vector3d::UnitX());  // head-on: y up becomes y down
  const Eigen::AngleAxisd lean(tilt, Eigen::Vector3d(std::cos(towards), std::sin(towards), 0));
  const Eigen::AngleAxisd turned(yaw, Eigen::Vector3d::UnitZ());
  return {Eigen::Quaterniond(lean * facing * turned), {off.x(), off.y(), distance}};
}

}  // namespace perch
