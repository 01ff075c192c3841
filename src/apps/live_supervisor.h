#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

namespace perch {

struct Supervision {
  double duration = 0;            // s; 0: no end
  std::filesystem::path output;   // folder of estimates.csv and states.csv; empty: none
  std::filesystem::path summary;  // file; empty: none
  const std::atomic<bool>& stop;  // set: end cleanly
  std::atomic<bool>& reload;      // set: said to be of no effect, and cleared
};

// Runs live until the end: opens everything, then looks after the threads, writes the log, feeds the service
// manager's watchdog while all go on, and writes the summary. The exit code.
int supervise(const std::filesystem::path& config, const std::vector<std::string>& overrides,
              const Supervision& supervision);

}  // namespace perch
