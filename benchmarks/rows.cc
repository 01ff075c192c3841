#include "rows.h"

namespace perch {

void time_poses(benchmark::State& state, std::span<const Shot> shots, const FindPose& find_pose) {
  // Every picture equally often: they differ in time as they do in error.
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(shots.size()))) {
    for (const Shot& shot : shots) benchmark::DoNotOptimize(find_pose(shot));
  }
  double mm = 0, mrad = 0;
  int found = 0;
  for (const Shot& shot : shots) {
    const auto pose = find_pose(shot);
    if (!pose) continue;
    ++found;
    mm += 1e3 * (pose->translation - shot.camera_from_target.translation).norm();
    mrad += 1e3 * pose->rotation.angularDistance(shot.camera_from_target.rotation);
  }
  state.counters["err_mm"] = mm / found;  // none found: NaN, as it should be
  state.counters["err_mrad"] = mrad / found;
  state.counters["found"] = static_cast<double>(found) / static_cast<double>(shots.size());
}

std::optional<Rigid3> answer(const PoseResult& result) {
  if (result.status != PoseStatus::kOk && result.status != PoseStatus::kAmbiguous) return {};
  return result.camera_from_target.mean;
}

FindPose find_by(Detector& detector, PoseEstimator& estimator) {
  return [&](const Shot& shot) -> std::optional<Rigid3> {
    const Detection& found = detector.detect(shot.grey, shot.prediction);
    if (found.status != DetectionStatus::kFound) return {};
    return answer(estimator.estimate(found));
  };
}

}  // namespace perch
