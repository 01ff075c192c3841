#pragma once

#include <memory>

#include "perch/camera/camera_model.h"
#include "perch/detection/detector.h"
#include "perch/detection/edges_options.h"
#include "perch/target/landing_target.h"

namespace perch {

// Propose, verify, measure: white squares on black, by a fixed threshold and, where that finds nothing, by
// local contrast, suggest homographies; one that explains all edges that should be seen is a target; their
// sub-pixel places, through the lens model, are the measurement. With a prediction, the edges are measured
// where it puts them, and that nearly all are there confirms the target; else they are looked for about there
// first, and far fewer of them suffice.
class EdgesDetector : public Detector {
 public:
  // Throws std::invalid_argument when the target is no layout of squares.
  EdgesDetector(const LandingTarget& target, const CameraModel& camera, const EdgesOptions& options);
  ~EdgesDetector() override;

  const Detection& detect(const cv::Mat& grey, const std::optional<Prediction>& prediction) override;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace perch
