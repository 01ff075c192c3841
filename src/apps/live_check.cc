#include "live_check.h"

#include <chrono>
#include <iostream>
#include <thread>

#include "perch/frames/axis_test.h"
#include "perch/links/byte_stream.h"

namespace perch {
namespace {

using namespace std::chrono_literals;

constexpr int64_t kSecond = 1'000'000'000;
// A serial link of 57600 baud reads a parameter in 0.1 s; one that the autopilot does not have is asked for
// three times.
constexpr int64_t kMostWait = 30 * kSecond;
// Rates are those of 2 to 4 s after the last request.
constexpr int64_t kRatesSettle = 4 * kSecond;
constexpr int64_t kMostPatience = 60 * kSecond;  // of a move on the bench
constexpr auto kLook = 20ms;

void wait_for_answers(LiveRun& run, const std::atomic<bool>& stop) {
  const int64_t begin_ns = monotonic_ns();
  int64_t settled_ns = 0;
  while (!stop && !run.finished() && monotonic_ns() - begin_ns < kMostWait) {
    std::this_thread::sleep_for(kLook);
    if (!run.link()->settled()) continue;
    if (settled_ns == 0) settled_ns = monotonic_ns();
    if (monotonic_ns() - settled_ns > kRatesSettle) return;
  }
}

int say_camera(LiveRun& run) {
  const LiveCounters camera = run.camera_counters();
  if (camera.frames == 0) {
    std::cout << "error: camera: no picture came"
              << (camera.last_problem.empty() ? "" : ": " + camera.last_problem) << '\n';
    return 1;
  }
  std::cout << "camera: " << camera.frames << " pictures, " << run.frames().of(EstimateStatus::kOk)
            << " with a pose; pad " << name_of(run.pad_state()) << '\n';
  return 0;
}

// What the bench sees of the pad, until the verdict; nothing when it is told to stop, or patience ends.
std::optional<AxisTest::Verdict> watch_move(LiveRun& run, BodyAxis axis, const std::atomic<bool>& stop) {
  AxisTest test(axis);
  bool asked = false;
  int64_t last_ns = 0;
  const int64_t begin_ns = monotonic_ns();
  std::cout << "Hold the pad still, whole in the camera's view.\n" << std::flush;
  while (!stop && !run.finished() && monotonic_ns() - begin_ns < kMostPatience) {
    std::this_thread::sleep_for(kLook / 4);
    const auto state = run.last_state();
    if (!state || state->source != StateSource::kVision || state->timestamp_ns == last_ns) continue;
    last_ns = state->timestamp_ns;
    const auto verdict = test.see(last_ns, inverse(state->pad_from_body).translation);
    if (verdict) return verdict;
    if (test.may_move() && !asked) {
      asked = true;
      std::cout << "Move it 20 to 30 cm " << direction_name(axis)
                << ", as the vehicle means it, and hold it still.\n"
                << std::flush;
    }
  }
  return std::nullopt;
}

}  // namespace

int run_check(LiveRun& run, const std::atomic<bool>& stop) {
  wait_for_answers(run, stop);
  if (stop) return 1;
  auto snapshot = run.link()->snapshot();
  const LiveHistograms latency = run.latency().all();
  const auto& camera = latency[static_cast<size_t>(LiveStage::kCamera)];
  const auto& estimate = latency[static_cast<size_t>(LiveStage::kEstimate)];
  if (camera.count() > 0) snapshot.latency = 1e-6 * (camera.quantile_us(0.5) + estimate.quantile_us(0.5));
  int wrong = say_camera(run);
  if (!snapshot.heard && !run.link()->connection_problem().empty()) {
    std::cout << "error: " << run.link()->connection_problem() << '\n';
  }
  if (snapshot.heard) std::cout << "autopilot: " << run.link()->autopilot_text() << '\n';
  for (const mavlink::Finding& finding : mavlink::examine(snapshot)) {
    std::cout << to_text(finding) << '\n';
    if (finding.severity != mavlink::FindingSeverity::kNote) wrong = 1;
  }
  if (!wrong) std::cout << "nothing is wrong\n";
  return wrong;
}

int run_bench(LiveRun& run, const std::atomic<bool>& stop) {
  int wrong = 0;
  for (const BodyAxis axis : {BodyAxis::kForward, BodyAxis::kRight, BodyAxis::kDown}) {
    const auto verdict = watch_move(run, axis, stop);
    if (!verdict) {
      std::cout << "error: " << direction_name(axis)
                << ": the pad was not seen to be still, to move and to be "
                << "still again\n";
      return 1;
    }
    std::cout << (verdict->good ? "good: " : "error: ") << "moved " << direction_name(axis)
              << ", seen to move " << verdict->seen
              << (verdict->good ? "" : "; look at frames.body_from_base") << '\n';
    if (!verdict->good) wrong = 1;
  }
  return wrong;
}

}  // namespace perch
