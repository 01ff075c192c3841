#pragma once

#include <memory>

#include "perch/camera/camera_model.h"
#include "perch/config/section.h"
#include "perch/detection/apriltag_detector.h"
#include "perch/detection/detector.h"
#include "perch/detection/edges_detector.h"
#include "perch/detection/squares_detector.h"
#include "perch/target/landing_target.h"

namespace perch {

enum class DetectionMethod { kEdges, kPaper };

struct DetectionOptions {
  DetectionMethod method = DetectionMethod::kEdges;  // of a target of squares
  // Whether the target is first looked for where the frames before lead to expect it.
  bool follow = true;
  EdgesOptions edges;
  PaperOptions paper;
  AprilTagOptions apriltag;  // of a target that is an AprilTag board
};

// Reads the `detection` section and refuses unknown keys.
DetectionOptions read_detection_options(Section detection);

// The detector that the target asks for: squares by `detection.method`, tags by libapriltag. Throws
// std::invalid_argument when the method cannot serve the target.
std::unique_ptr<Detector> make_detector(const LandingTarget& target, const CameraModel& camera,
                                        const DetectionOptions& options);

}  // namespace perch
