#pragma once

#include <memory>

#include "perch/camera/camera_model.h"
#include "perch/config/section.h"
#include "perch/detection/detector.h"
#include "perch/target/landing_target.h"

namespace perch {

struct EdgesOptions {
  // Where the threshold of the first proposal lies between the lowest and the highest grey level.
  double threshold_fraction = 0.5;
  // Lines of the raster measured across an edge, at most; more are more accurate and take longer.
  int lines_per_edge = 64;
  // The least step between black and white that counts, grey levels.
  double min_contrast = 12;
  // Part of the lines across the squares' and the border's inner edges that must show the step they should.
  // Three covered squares of six leave 57 %.
  double min_found = 0.52;
  // What no residual of a frame shows, of each piece of an edge: the print. What the whole frame shows (the
  // lens model, the shutter) is learnt from the frames: pose/deformation.h.
  double systematic_px = 0.002;
};

// Reads the section and refuses unknown keys.
EdgesOptions read_edges_options(Section edges);

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
