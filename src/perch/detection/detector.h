#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "perch/detection/plane_fit.h"
#include "perch/geometry/uncertainty.h"

namespace perch {

// A measured feature of the target.
struct Correspondence {
  int feature = 0;  // index into LandingTarget::features
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 1;  // standard deviation of each coordinate
};

// A measured piece of an edge, for people: where it is, and how far off the homography that fits all best.
struct EdgeResidual {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();   // the middle of the piece
  Eigen::Vector2f normal = Eigen::Vector2f::Zero();  // unit, from black to white
  float left_px = 0;                                 // found further towards white by so much
};

// All measured edges of a frame at once: the homography that they fit best, and how well they know it. What
// it loses of them is what is beyond second order in a step of a fraction of a pixel.
struct PlaneMeasurement {
  Eigen::Matrix3d image_from_plane = Eigen::Matrix3d::Identity();  // as in plane_fit.h
  ImageFrame frame;
  PlaneInformation information = PlaneInformation::Zero();  // of a PlaneStep about it
  double rms_px = 0;                                        // of the edges' distances from it
  double sigma_px = 1;                                      // of an edge, as the information has it
  double growth_px = 0;                                     // of white on every side: blooming
  double blur_px = 0;                                       // deviation, as far as it is known
  int edges = 0;                                            // pieces of edges
};

// kAmbiguous: several targets in the picture, and nothing tells which is the pad.
enum class DetectionStatus { kFound, kNoTarget, kPartial, kAmbiguous };

// How long a step of the detector took.
struct StageTime {
  std::string_view stage;  // of static storage: "threshold", "segmentation", ...
  double us = 0;
};

struct Detection {
  DetectionStatus status = DetectionStatus::kNoTarget;
  std::vector<Correspondence> correspondences;  // empty unless found
  std::optional<PlaneMeasurement> plane;        // with `edges`: what the correspondences are drawn from
  std::vector<EdgeResidual> residuals;          // with `edges`
  std::vector<StageTime> stages;
  int threshold = -1;  // grey level, where the method has one
};

// Where the target is expected, from the previous frames.
struct Prediction {
  UncertainRigid3 camera_from_target;
  double blur_px = 0;  // of the edges; 0: nobody knows
};

// Finds the target in a picture. Keeps its buffers from call to call, so one Detector serves one thread; it
// remembers nothing else: the same picture and prediction give the same result.
class Detector {
 public:
  virtual ~Detector() = default;
  // `grey` is CV_8UC1 of any size. The result is reused by the next call.
  virtual const Detection& detect(const cv::Mat& grey, const std::optional<Prediction>& prediction) = 0;
};

}  // namespace perch
