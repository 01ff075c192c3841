#pragma once

#include <atomic>

#include "live_run.h"

namespace perch {

// perch-live --check: waits for the autopilot's parameters, streams and clock, and says in words what keeps
// it from landing on vision. The exit code: 0 when nothing does.
int run_check(LiveRun& run, const std::atomic<bool>& stop);

// perch-live --check --bench: asks for the pad to be moved along each axis of the vehicle, and says whether
// it was seen to move that way.
int run_bench(LiveRun& run, const std::atomic<bool>& stop);

}  // namespace perch
