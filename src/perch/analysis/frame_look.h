#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/geometry/rigid3.h"
#include "perch/target/landing_target.h"

namespace perch {

// How a picture's grey levels are spread, coarsely.
struct GreyHistogram {
  static constexpr size_t kBins = 32;   // of 8 grey levels each
  std::array<uint16_t, kBins> share{};  // of the pixels, 65535ths; all 0 without a picture
};

// Of every fourth pixel of every fourth row: `grey` is CV_8UC1, or empty.
GreyHistogram grey_histogram(const cv::Mat& grey);

// How the target looks in a picture at its recovered pose.
struct TargetLook {
  // The part of its face that is in the picture and has the colour it should have: what is beyond the
  // picture's edge, covered, or as dark by a shadow as its black, is not visible.
  double visible = 0;
  double white = std::numeric_limits<double>::quiet_NaN();  // medians, grey levels; NaN when none is seen
  double black = std::numeric_limits<double>::quiet_NaN();
};

// Looks at some hundred places all over a target that have one colour around them. Whatever method found it.
class TargetViewer {
 public:
  explicit TargetViewer(const LandingTarget& target);
  TargetLook look(const cv::Mat& grey, const CameraModel& camera, const Rigid3& camera_from_target) const;

 private:
  struct Place {
    Eigen::Vector3d p_target;
    bool white;
  };
  std::vector<Place> places_;
};

}  // namespace perch
