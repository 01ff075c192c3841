#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/geometry/rigid3.h"
#include "perch/target/landing_target.h"

namespace perch {

// The pictures that all rows share: for each pose the squares target and an AprilTag, both 1 m across with
// their white margins, lying in the same place on the same textured ground.
struct View {
  Rigid3 camera_from_target;
  cv::Mat squares, tag;
};

struct Scene {
  CameraModel camera;
  LandingTarget squares, tag;
  std::vector<View> views;
};

inline const cv::Size kResolutions[] = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}};

// Made at the first call for each resolution, and kept. 24 poses from a fixed seed: 2 to 8 m away, tilted by
// up to 35 degrees, turned anyhow, wholly in view; the same poses at each resolution, a lens of the same 56
// degrees across.
const Scene& scene(cv::Size resolution);

}  // namespace perch
