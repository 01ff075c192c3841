#pragma once

#include <memory>

#include "perch/config/section.h"
#include "perch/detection/detector.h"
#include "perch/target/landing_target.h"

namespace perch {

// Every parameter of the paper's method, with the paper's value where it gives one.
struct PaperOptions {
  // Rows of the histogram: every seventh (section 3.1: "one-seventh of the total image pixels").
  int histogram_row_step = 7;
  // Where the threshold lies between the lowest and the highest grey level (section 2.1.1).
  double threshold_fraction = 0.65;
  // Rows of the segmentation: every second, the paper's half resolution. Its find_features skips more in
  // larger pictures, to stay at 160x120; that would halve the range at 640x480, and with runs the rows are
  // cheap.
  int segmentation_row_step = 2;
  // Regions of fewer sampled pixels are noise (section 2.1.2). A square 2.5 px wide has 3 to 6.
  int min_component_px = 3;
  // The paper asks that the target's region hold its components and no others, which fails where its border
  // merges with a pale floor or wall. False: what lies in the black interior is enough.
  bool count_region = true;
  // How far the corner of a region, the centre of a pixel inside it, lies inside the true corner: 0.7 px for
  // the outermost pixel centre of a digitised right angle, and 0.3 px more as a threshold at 65 % leaves
  // less of a blurred square than one halfway would. 0 is the paper's integer corner, which makes a target of
  // 50 px 5 % too small.
  double corner_inset_px = 1.0;
  // Of each coordinate of such a corner: quantisation (a pixel's 0.29), blur and noise.
  double corner_sigma_px = 0.5;
};

// Reads the section and refuses unknown keys.
PaperOptions read_paper_options(Section paper);

// The paper's detector, chapter 2.1: threshold, two passes of connected components, four corners of each
// square, labels. Beyond the paper: the squares lie in the black component and that in the white border, the
// corners of each square explain its area, and of several candidates the largest wins. Whether it is the
// target at all is the pose's residual to decide. Of a nested target it measures the outer squares, and the
// inner ones where these are not all in the picture.
class SquaresDetector : public Detector {
 public:
  // Throws std::invalid_argument when the target is no layout of squares or cannot be labelled this way.
  SquaresDetector(const LandingTarget& target, const PaperOptions& options);
  ~SquaresDetector() override;

  const Detection& detect(const cv::Mat& grey, const std::optional<Prediction>& prediction) override;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace perch
