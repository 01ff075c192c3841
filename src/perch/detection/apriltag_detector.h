#pragma once

#include <memory>

#include "perch/config/section.h"
#include "perch/detection/detector.h"
#include "perch/target/landing_target.h"

namespace perch {

struct AprilTagOptions {
  // Quads are searched in every n-th pixel: 1, 1.5, 2, 3 or 4. 2 takes a quarter of the time of 1 and finds
  // tags down to twice the size; corners are measured at full resolution either way.
  double quad_decimate = 2;
  double quad_sigma = 0;  // blur before the search, px: for noise above some 10 grey levels
  bool refine_edges =
      true;  // fit the tag's edges at full resolution; without it corners are those of the search
  // One: the pictures come one after the other and the cores have other work.
  int threads = 1;
  // Wrong bits corrected. A random quad of 36 bits passes for one given tag with 4 / 2^36 at 0, 37 times that
  // at 1: at a thousand quads a picture and 30 Hz once in days or once in hours. A wrong pose is worse than
  // none.
  int max_hamming = 0;
  // Mean distance of the data bits from the black/white threshold, in grey levels. Below it bits are noise: a
  // sensor at high gain has some 5 levels of it.
  double min_decision_margin = 10;
};

// Reads `detection.apriltag`, keys as above, and refuses unknown ones. Throws ConfigError.
AprilTagOptions read_apriltag_options(Section apriltag);

// Finds the tags of a board with libapriltag. Correspondence 4 i + k is corner k of board.tags[i]: upper
// right, upper left, lower left, lower right as printed. Tags that are not on the board are ignored; of an id
// seen twice (a reflection, a second pad) neither can be trusted, and both are dropped. One tag is enough for
// kFound. The prediction is not used.
class AprilTagDetector final : public Detector {
 public:
  // Throws std::invalid_argument for a family or border libapriltag cannot have (see make_apriltag_family),
  // ids outside of the family or twice on the board, and options out of their ranges.
  explicit AprilTagDetector(const AprilTagBoard& board, const AprilTagOptions& options = {});
  ~AprilTagDetector() override;

  const Detection& detect(const cv::Mat& grey, const std::optional<Prediction>& prediction) override;

 private:
  struct Library;  // libapriltag's structs and our buffers
  std::unique_ptr<Library> library_;
  Detection detection_;
};

}  // namespace perch
