#include "perch/detection/make_detector.h"

namespace perch {

DetectionOptions read_detection_options(Section detection) {
  DetectionOptions options;
  std::string method = "paper";
  detection.read_choice("method", method, {{"paper", std::string("paper")}});
  options.paper = read_paper_options(detection.section("paper"));
  options.apriltag = read_apriltag_options(detection.section("apriltag"));
  detection.done();
  return options;
}

std::unique_ptr<Detector> make_detector(const LandingTarget& target, const DetectionOptions& options) {
  if (const auto* board = std::get_if<AprilTagBoard>(&target.layout)) {
    return std::make_unique<AprilTagDetector>(*board, options.apriltag);
  }
  return std::make_unique<SquaresDetector>(target, options.paper);
}

}  // namespace perch
