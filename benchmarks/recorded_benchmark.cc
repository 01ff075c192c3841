// The whole frame on recorded flights with exact truth, where they are there (PERCH_SHARED, see
// tests/support/shared.h).

#include <map>

#include "perch/camera/csv.h"
#include "perch/camera/image_source.h"
#include "perch/detection/make_detector.h"
#include "rows.h"
#include "support/shared.h"

namespace perch {
namespace {

std::map<int64_t, Rigid3> read_truth(const std::filesystem::path& file) {
  std::map<int64_t, Rigid3> truth;
  CsvReader csv(file);
  while (csv.next()) {
    const auto fields = csv.fields();
    const auto number = [&](size_t i) { return parse_finite(fields[i]).value(); };
    truth[parse_integer(fields[0]).value()] = {
        Eigen::Quaterniond(number(4), number(5), number(6), number(7)).normalized(),
        Eigen::Vector3d(number(1), number(2), number(3))};
  }
  return truth;
}

void recorded(benchmark::State& state, const std::filesystem::path& flight, DetectionMethod method) {
  const auto truth = read_truth(flight / "mav0/cam0/truth_target_pose.csv");
  const CameraModel camera = read_camera_model(flight / "mav0/cam0/sensor.yaml");
  const LandingTarget target =
      read_target(std::filesystem::path(PERCH_SOURCE_DIR) / "configs/targets/sharp.yaml");
  std::vector<Shot> shots;
  const auto source = open_image_source("flight:" + flight.string());
  for (Frame frame; source->next(frame);) {
    const auto exact = truth.find(frame.timestamp_ns);
    if (!frame.grey.empty() && exact != truth.end()) shots.push_back({frame.grey.clone(), exact->second});
  }
  if (shots.empty()) return state.SkipWithError("no picture with a truth");
  DetectionOptions options;
  options.method = method;
  const auto detector = make_detector(target, camera, options);
  PoseEstimator estimator(target, camera, {});
  time_poses(state, shots, find_by(*detector, estimator));
}

const bool kRegistered = [] {
  for (const std::string name : {"dev_descent", "dev_hard"}) {
    const auto flight = shared_flight(name);
    if (flight.empty()) continue;
    for (const auto& [method, row] :
         {std::pair(DetectionMethod::kPaper, "paper"), {DetectionMethod::kEdges, "edges"}}) {
      benchmark::RegisterBenchmark(
          (std::string(row) + "/recorded/" + name).c_str(),
          [=, method = method](benchmark::State& state) { recorded(state, flight, method); })
          ->Unit(benchmark::kMicrosecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace perch
