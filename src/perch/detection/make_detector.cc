#include "perch/detection/make_detector.h"

namespace perch {

DetectionOptions read_detection_options(Section detection) {
  DetectionOptions options;
  detection.read_choice("method", options.method,
                        {{"edges", DetectionMethod::kEdges}, {"paper", DetectionMethod::kPaper}});
  detection.read("follow", options.follow);
  options.edges = read_edges_options(detection.section("edges"));
  options.paper = read_paper_options(detection.section("paper"));
  options.apriltag = read_apriltag_options(detection.section("apriltag"));
  detection.done();
  return options;
}

std::unique_ptr<Detector> make_detector(const LandingTarget& target, const CameraModel& camera,
                                        const DetectionOptions& options) {
  if (const auto* board = std::get_if<AprilTagBoard>(&target.layout)) {
    return std::make_unique<AprilTagDetector>(*board, options.apriltag);
  }
  if (options.method == DetectionMethod::kEdges) {
    return std::make_unique<EdgesDetector>(target, camera, options.edges);
  }
  return std::make_unique<SquaresDetector>(target, options.paper);
}

}  // namespace perch
