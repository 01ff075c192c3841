// Our own way of a picture, on the same scenes as the peers: the whole frame from the picture to pose and
// covariance, and the detection and the pose by themselves. The stages of the detection are counters of its
// row, in us, measured as the running program measures them.

#include <map>

#include "perch/detection/make_detector.h"
#include "perch/simulation/random.h"
#include "rows.h"
#include "scene.h"

namespace perch {
namespace {

DetectionOptions by(DetectionMethod method) {
  DetectionOptions options;
  options.method = method;
  return options;
}

// Of what a filter claims, what its predictions are off: the row's off_px is then what it is on the simulated
// landing, 0.11 to 0.15 px in the median.
constexpr double kUsual = 0.03;

// What a filter expects a frame after the last: it says 2 cm and a degree, and is off by `part` of that.
Prediction near(const Rigid3& truth, double part, RandomStream& random) {
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(4e-4), Eigen::Vector3d::Constant(3e-4);
  PoseError error;
  for (int i = 0; i < 6; ++i) error(i) = part * std::sqrt(covariance(i, i)) * random.normal();
  return {{perturb(truth, error), covariance}, 0.75};
}

// How far a prediction puts the worst of the target's corners off, px.
double off_px(const Scene& shared, const Rigid3& truth, const Rigid3& predicted) {
  double worst = 0;
  for (const Feature& feature : shared.squares.features) {
    const Eigen::Vector3d point(feature.point.x(), feature.point.y(), 0);
    const auto seen = shared.camera.pixel_from_camera(truth * point);
    const auto expected = shared.camera.pixel_from_camera(predicted * point);
    if (seen && expected) worst = std::max(worst, (*expected - *seen).norm());
  }
  return worst;
}

void frame(benchmark::State& state, const SceneKind& kind, const DetectionOptions& options,
           std::optional<double> off) {
  const Scene& shared = scene(kind);
  const auto detector = make_detector(shared.squares, shared.camera, options);
  PoseEstimator estimator(shared.squares, shared.camera, {});
  std::vector<Shot> shots;
  RandomStream random(7);
  double sum = 0;
  for (const View& view : shared.views) {
    shots.push_back({view.squares, view.camera_from_target});
    if (!off) continue;
    shots.back().prediction = near(view.camera_from_target, *off, random);
    sum += off_px(shared, view.camera_from_target, shots.back().prediction->camera_from_target.mean);
  }
  time_poses(state, shots, find_by(*detector, estimator));
  if (off) state.counters["off_px"] = sum / static_cast<double>(shots.size());
}

void detection(benchmark::State& state, const SceneKind& kind, const DetectionOptions& options) {
  const Scene& shared = scene(kind);
  const auto detector = make_detector(shared.squares, shared.camera, options);
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

void pose(benchmark::State& state, const SceneKind& kind, const DetectionOptions& options) {
  const Scene& shared = scene(kind);
  const auto detector = make_detector(shared.squares, shared.camera, options);
  PoseEstimator estimator(shared.squares, shared.camera, {});
  std::vector<Detection> found;
  for (const View& view : shared.views) {
    const Detection& detection = detector->detect(view.squares, {});
    if (detection.status == DetectionStatus::kFound) found.push_back(detection);
  }
  if (found.empty()) return state.SkipWithError("no target found");
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(found.size()))) {
    for (const Detection& detection : found) benchmark::DoNotOptimize(estimator.estimate(detection));
  }
}

const bool kRegistered = [] {
  for (const SceneKind& kind : kScenes) {
    const std::string name = "/" + name_of(kind);
    const auto add = [&](const std::string& row, auto run) {
      benchmark::RegisterBenchmark((row + name).c_str(), [=](benchmark::State& state) {
        run(state, kind);
      })->Unit(benchmark::kMicrosecond);
    };
    for (const auto& [method, which] :
         {std::pair(DetectionMethod::kPaper, "paper"), {DetectionMethod::kEdges, "edges"}}) {
      const DetectionOptions options = by(method);
      const std::string row = which;
      add(row + "_frame", [=](auto& state, const SceneKind& k) { frame(state, k, options, {}); });
      if (method == DetectionMethod::kEdges) {
        add(row + "_follow", [=](auto& state, const SceneKind& k) { frame(state, k, options, kUsual); });
        add(row + "_bump", [=](auto& state, const SceneKind& k) { frame(state, k, options, 1); });
      }
      add(row + "_detection", [=](auto& state, const SceneKind& k) { detection(state, k, options); });
      add(row + "_pose", [=](auto& state, const SceneKind& k) { pose(state, k, options); });
    }
  }
  return true;
}();

}  // namespace
}  // namespace perch
