// perch-live: from a camera and an autopilot to LANDING_TARGET.

#include <gflags/gflags.h>
#include <glog/logging.h>

#include <atomic>
#include <csignal>
#include <iostream>

#include "live_check.h"
#include "live_supervisor.h"
#include "program.h"

DEFINE_string(config, "", "the run's configuration, a YAML file; see configs/live");
DEFINE_string(set, "", "key.path=value: overrides the configuration; may be given several times");
DEFINE_bool(print_config, false, "prints the configuration with every default, and ends");
DEFINE_double(duration, 0, "ends after so many seconds; 0: only when told to, or at a recording's end");
DEFINE_string(output, "", "a folder for estimates.csv and states.csv, as perch-batch writes them");
DEFINE_string(summary, "", "a file for the closing summary, JSON");
DEFINE_bool(check, false, "examines the autopilot's set-up, says what is wrong, and ends");
DEFINE_bool(bench, false, "with --check: has the pad moved by hand, and verifies signs and axes");

namespace perch {
namespace {

constexpr char kDescription[] =
    "Tells an autopilot where the landing pad is, picture by picture, with the moment of exposure right, "
    "and\n"
    "nothing while there is no pose to be trusted. Replays a recorded flight (camera.source: "
    "flight:FOLDER),\n"
    "estimate by estimate.";

std::atomic<bool> stop_requested = false;
std::atomic<bool> reload_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may only touch lock-free atomics");

void handle_signals() {
  std::signal(SIGINT, [](int) { stop_requested = true; });
  std::signal(SIGTERM, [](int) { stop_requested = true; });
  std::signal(SIGHUP, [](int) { reload_requested = true; });
  std::signal(SIGPIPE, SIG_IGN);  // a log nobody reads any more
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may grow no more: the recorder counts that
}

void check_flags(const CommandLine& line) {
  if (!line.arguments.empty()) throw UsageError("expected flags only, found \"" + line.arguments[0] + '"');
  if (FLAGS_config.empty()) throw UsageError("expected --config");
  if (!(FLAGS_duration >= 0)) throw UsageError("--duration: expected 0 or more");
  if (FLAGS_bench && !FLAGS_check) throw UsageError("--bench: expected with --check");
  if (FLAGS_check && (!FLAGS_output.empty() || !FLAGS_summary.empty()))
    throw UsageError("--check: expected without --output and --summary");
}

int check(const LiveConfig& given) {
  if (given.nav != NavSource::kMavlink && !FLAGS_bench)
    throw ConfigError(FLAGS_config + ": nav: expected mavlink+URL, as --check examines an autopilot");
  LiveConfig config = given;
  config.mavlink.send = false;
  LiveRun run(config, open_source_of(config), {}, {});
  return FLAGS_bench ? run_bench(run, stop_requested) : run_check(run, stop_requested);
}

int run(const CommandLine& line) {
  check_flags(line);
  if (!line.given.count("minloglevel")) FLAGS_minloglevel = google::GLOG_INFO;
  std::vector<std::string> overrides = line.all("set");
  Section root = Section::load(FLAGS_config, overrides);
  const LiveConfig config = read_live_config(root);
  if (FLAGS_print_config) {
    std::cout << root.resolved();
    return 0;
  }
  handle_signals();
  if (FLAGS_check) return check(config);
  return supervise(FLAGS_config, overrides,
                   {FLAGS_duration, FLAGS_output, FLAGS_summary, stop_requested, reload_requested});
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  return perch::run_program(argc, argv, {"perch-live", "--config C.yaml [flags]", perch::kDescription},
                            perch::run);
}
