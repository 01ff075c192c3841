// Our own way of a picture, on the same scenes as the peers: the whole frame from the picture to pose and
// covariance, and the detection and the pose by themselves. The stages of the detection are counters of its
// row, in us, measured as the running program measures them.

#include <map>

#include "perch/detection/make_detector.h"
#include "rows.h"
#include "scene.h"

namespace perch {
namespace {

void frame(benchmark::State& state, cv::Size size) {
  const Scene& shared = scene(size);
  const auto detector = make_detector(shared.squares, {});
  PoseEstimator estimator(shared.squares, shared.camera, {});
  std::vector<Shot> shots;
  for (const View& view : shared.views) shots.push_back({view.squares, view.camera_from_target});
  time_poses(state, shots, find_by(*detector, estimator));
}

void detection(benchmark::State& state, cv::Size size) {
  const Scene& shared = scene(size);
  const auto detector = make_detector(shared.squares, {});
  std::map<std::string, double> stage_us;
  double pixels = 0, corners = 0, pictures = 0;
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(shared.views.size()))) {
    for (const View& view : shared.views) {
      const Detection& found = detector->detect(view.squares, {});
      pictures += 1;
      for (const StageTime& time : found.stages) stage_us[std::string(time.stage)] += time.us;
    }
  }
  for (const View& view : shared.views) {
    for (const Correspondence& c : detector->detect(view.squares, {}).correspondences) {
      const Eigen::Vector2d& point = shared.squares.features[static_cast<size_t>(c.feature)].point;
      const Eigen::Vector3d p_camera = view.camera_from_target * Eigen::Vector3d(point.x(), point.y(), 0);
      pixels += (c.pixel - shared.camera.pixel_from_camera(p_camera).value_or(Eigen::Vector2d::Zero()))
                    .squaredNorm();
      corners += 1;
    }
  }
  for (const auto& [stage, us] : stage_us) state.counters[stage + "_us"] = us / pictures;
  state.counters["rms_px"] = std::sqrt(pixels / corners);
}

void pose(benchmark::State& state, cv::Size size) {
  const Scene& shared = scene(size);
  const auto detector = make_detector(shared.squares, {});
  PoseEstimator estimator(shared.squares, shared.camera, {});
  std::vector<std::vector<Correspondence>> found;
  for (const View& view : shared.views) {
    const Detection& detection = detector->detect(view.squares, {});
    if (detection.status == DetectionStatus::kFound) found.push_back(detection.correspondences);
  }
  if (found.empty()) return state.SkipWithError("no target found");
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(found.size()))) {
    for (const auto& correspondences : found)
      benchmark::DoNotOptimize(estimator.estimate(correspondences, {}));
  }
}

const bool kRegistered = [] {
  for (const cv::Size size : kResolutions) {
    const std::string name = "/" + resolution_name(size);
    const auto add = [&](const std::string& row, auto run) {
      benchmark::RegisterBenchmark((row + name).c_str(), [=](benchmark::State& state) {
        run(state, size);
      })->Unit(benchmark::kMicrosecond);
    };
    add("perch_frame", frame);
    add("perch_detection", detection);
    add("perch_pose", pose);
  }
  return true;
}();

}  // namespace
}  // namespace perch
