// What others do with a tag where our target lies: libapriltag and OpenCV's ArUco on an AprilTag of the same
// outer size, one thread each. All poses come from the same estimator, so that rows differ by what was
// detected alone.

#include <opencv2/aruco.hpp>

#include "perch/detection/apriltag_detector.h"
#include "rows.h"
#include "scene.h"

namespace perch {
namespace {

std::vector<Shot> tag_shots(const Scene& scene) {
  std::vector<Shot> shots;
  for (const View& view : scene.views) shots.push_back({view.tag, view.camera_from_target});
  return shots;
}

void libapriltag(benchmark::State& state, const SceneKind& kind, double decimate) {
  const Scene& shared = scene(kind);
  AprilTagOptions options;
  options.quad_decimate = decimate;
  AprilTagDetector detector(std::get<AprilTagBoard>(shared.tag.layout), options);
  PoseEstimator estimator(shared.tag, shared.camera, {});
  time_poses(state, tag_shots(shared), find_by(detector, estimator));
}

// ArUco goes clockwise from the upper left corner, and its AprilTag dictionaries stand on their heads.
std::vector<Correspondence> correspondences(const std::vector<cv::Point2f>& corners) {
  constexpr size_t kArucoCorner[] = {3, 2, 1, 0};  // of upper right, upper left, lower left, lower right
  constexpr double kSigmaPx = 1;                   // corners of a contour, unrefined by default
  std::vector<Correspondence> list;
  for (int k = 0; k < 4; ++k) {
    const cv::Point2f& corner = corners[kArucoCorner[k]];
    list.push_back({k, Eigen::Vector2d(corner.x, corner.y), kSigmaPx});
  }
  return list;
}

void aruco(benchmark::State& state, const SceneKind& kind, bool aruco3) {
  const Scene& shared = scene(kind);
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  const auto parameters = cv::aruco::DetectorParameters::create();
  if (aruco3) {
    // Without a smallest marker to look for, the mode searches the full picture and is the default again. In
    // these scenes no tag is below 0.07 of the picture's longer side.
    parameters->useAruco3Detection = true;
    parameters->minMarkerLengthRatioOriginalImg = 0.05f;
    parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;  // the mode asks for it
  }
  PoseEstimator estimator(shared.tag, shared.camera, {});
  const int id = std::get<AprilTagBoard>(shared.tag.layout).tags[0].id;
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  time_poses(state, tag_shots(shared), [&](const Shot& shot) -> std::optional<Rigid3> {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(shot.grey, dictionary, corners, ids, parameters);
    if (ids.size() != 1 || ids[0] != id) return {};
    return answer(estimator.estimate(correspondences(corners[0]), {}));
  });
  cv::setNumThreads(threads);
}

const bool kRegistered = [] {
  for (const SceneKind& kind : kScenes) {
    const std::string name = "/" + name_of(kind);
    const auto add = [&](const std::string& row, auto run) {
      benchmark::RegisterBenchmark((row + name).c_str(), run)->Unit(benchmark::kMicrosecond);
    };
    for (const int decimate : {1, 2}) {
      add("libapriltag_decimate_" + std::to_string(decimate),
          [=](benchmark::State& state) { libapriltag(state, kind, decimate); });
    }
    add("aruco", [=](benchmark::State& state) { aruco(state, kind, false); });
    add("aruco3", [=](benchmark::State& state) { aruco(state, kind, true); });
  }
  return true;
}();

}  // namespace
}  // namespace perch
