// How near the whole frame comes to what the picture allows: poses of one distance each, their errors beside
// the Cramer-Rao bound of the same pictures.

#include <benchmark/benchmark.h>

#include <cmath>
#include <map>
#include <vector>

#include "bound.h"
#include "perch/geometry/euler.h"
#include "perch/simulation/random.h"
#include "scene.h"
#include "support/whole_frame.h"

namespace perch {
namespace {

constexpr int kPoses = 60;  // an RMS scatters by 1 / sqrt(2 * 3 * 60), 5 %
constexpr double kFocal = 600, kTargetSize = 1;
const CameraModel& camera() {
  static const CameraModel camera = CameraModel::pinhole(kFocal, kFocal, 319.5, 239.5, 640, 480);
  return camera;
}

// 25 degrees of tilt in any direction, any yaw, up to 9 px from the middle of the picture: further out a
// target 2 m away would leave it.
Rigid3 random_pose(double distance, RandomStream& random) {
  const double direction = random.uniform(-M_PI, M_PI), off = 9 / kFocal * distance;
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(25 * kRadFromDeg, Eigen::Vector3d(std::cos(direction), std::sin(direction), 0)) *
      Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()) *
      Eigen::AngleAxisd(random.uniform(-M_PI, M_PI), Eigen::Vector3d::UnitZ());
  return {rotation, Eigen::Vector3d(random.uniform(-off, off), random.uniform(-off, off), distance)};
}

// The middle of the picture, as much as the target may cover: its diagonal, nearer by the tilt, with 9 px to
// move and 9 px of blur and steps on each side.
cv::Rect covered(double distance) {
  const int side = 2 * static_cast<int>(std::ceil(M_SQRT1_2 * kTargetSize * kFocal / (distance - 0.3) + 18));
  const cv::Rect whole(0, 0, camera().width(), camera().height());
  return whole & cv::Rect((whole.width - side) / 2, (whole.height - side) / 2, side, side);
}

struct Pictured {
  Rigid3 camera_from_target;
  cv::Mat grey;
  PoseCovariance bound;
};

// Made at the first call for each distance and ground, and kept.
const std::vector<Pictured>& views(const LandingTarget& target, double distance, bool textured) {
  static std::map<std::pair<double, bool>, std::vector<Pictured>> kept;
  std::vector<Pictured>& views = kept[{distance, textured}];
  if (!views.empty()) return views;
  RandomStream random(20, static_cast<uint64_t>(distance));
  for (int i = 0; i < kPoses; ++i) views.push_back({random_pose(distance, random), {}, {}});
  const SceneOptions light = textured ? scene_light() : without_texture(scene_light());
  const Renderer renderer(camera(), target, light, kSceneOptics);
  const Renderer even(window(camera(), covered(distance)), target, without_texture(scene_light()),
                      kSceneOptics);
  cv::parallel_for_(cv::Range(0, kPoses), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      Pictured& view = views[static_cast<size_t>(i)];
      const cv::Mat_<float> radiance = renderer.radiance(view.camera_from_target);
      view.grey = Sensor(scene_sensor()).picture(radiance, 3, static_cast<uint64_t>(i));
      view.bound = pose_bound(even, scene_sensor(), kTargetSize, view.camera_from_target);
    }
  });
  return views;
}

// Sums over the pictures in which the target was found.
struct Errors {
  double m2 = 0, rad2 = 0, bound_m2 = 0, bound_rad2 = 0, nees = 0;
  int found = 0;
  int wrong = 0;  // more than ten of its own sigmas off, and 5 % of the distance

  void add(const Pictured& view, const Estimate& estimate) {
    if (estimate.status != EstimateStatus::kOk) return;
    ++found;
    const auto& [mean, covariance] = estimate.camera_from_target;
    const PoseError error = pose_error(mean, view.camera_from_target);
    const double off = error.head<3>().norm();
    m2 += off * off;
    rad2 += error.tail<3>().squaredNorm();
    bound_m2 += view.bound.topLeftCorner<3, 3>().trace();
    bound_rad2 += view.bound.bottomRightCorner<3, 3>().trace();
    nees += normalised_error_squared(error, covariance);
    const double sigma = std::sqrt(covariance.topLeftCorner<3, 3>().trace());
    wrong += off > 10 * sigma && off > 0.05 * view.camera_from_target.translation.norm();
  }
};

void accuracy(benchmark::State& state, const RunConfig& config, double distance, bool textured) {
  Estimator estimator(config, camera());
  const auto& shown = views(config.target, distance, textured);
  int number = 0;
  const auto estimate = [&](const Pictured& view) {
    return estimator.process(lone_frame(number++, view.grey), level_pad(view.camera_from_target));
  };
  while (state.KeepRunningBatch(kPoses)) {
    for (const Pictured& view : shown) benchmark::DoNotOptimize(estimate(view));
  }
  Errors errors;
  double bound_m2 = 0;
  for (const Pictured& view : shown) {
    errors.add(view, estimate(view));
    bound_m2 += view.bound.topLeftCorner<3, 3>().trace();
  }
  state.counters["err_mm"] = 1e3 * std::sqrt(errors.m2 / errors.found);  // none found: NaN
  state.counters["bound_mm"] = 1e3 * std::sqrt(bound_m2 / kPoses);       // of all
  state.counters["over_bound"] = std::sqrt(errors.m2 / errors.bound_m2);
  state.counters["rot_over_bound"] = std::sqrt(errors.rad2 / errors.bound_rad2);
  state.counters["nees"] = errors.nees / errors.found;
  state.counters["found"] = static_cast<double>(errors.found) / kPoses;
  state.counters["wrong"] = errors.wrong;
}

void add_row(const std::string& name, const RunConfig& config, double distance, bool textured) {
  benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
    accuracy(state, config, distance, textured);
  })->Unit(benchmark::kMicrosecond);
}

const bool kRegistered = [] {
  for (const std::string& method : kMethods) {
    for (const int distance : {2, 5, 10, 20}) {
      const std::string row = "perch_accuracy/" + method + "/" + std::to_string(distance) + "m";
      add_row(row, run_config_of(method), distance, false);
      add_row(row + "_textured", run_config_of(method), distance, true);
    }
  }
  // What time buys: lines of the raster across an edge.
  for (const int lines : {8, 16, 32, 64, 128, 1000}) {
    RunConfig config = run_config_of("edges");
    config.detection.edges.lines_per_edge = lines;
    add_row("perch_lines/" + std::to_string(lines) + "/5m", config, 5, false);
  }
  return true;
}();

}  // namespace
}  // namespace perch
