// perch-batch: re-estimates recorded flights, scores them against navigation and writes the report.

#include <gflags/gflags.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for_each.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <fstream>
#include <iostream>
#include <map>
#include <mutex>
#include <thread>

#include "batch_compare.h"
#include "batch_flight.h"
#include "perch/analysis/error_table.h"
#include "perch/analysis/output_files.h"
#include "program.h"

DEFINE_string(config, "", "the run's configuration, a YAML file");
DEFINE_string(output, "", "the folder that the results are written to");
DEFINE_int32(jobs, 0, "how many threads; 0: as many as there are cores");
DEFINE_string(shard, "1/1", "k/n: only every n-th flight, beginning with the k-th");
DEFINE_string(manifest, "", "a file that names a flight a line, relative to itself; # begins a comment");
DEFINE_string(compare, "", "the output of an earlier run: prints what changed against it");
DEFINE_string(set, "", "key.path=value: overrides the configuration; may be given several times");
DEFINE_bool(print_config, false, "prints the configuration with every default, and ends");

namespace perch {
namespace {

namespace fs = std::filesystem;

std::atomic<bool> stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may only touch lock-free atomics");

void request_stop(int) { stop_requested = true; }

std::vector<fs::path> read_manifest(const fs::path& file) {
  std::ifstream stream(file);
  if (!stream) throw UsageError("--manifest " + file.string() + ": cannot be read");
  std::vector<fs::path> flights;
  for (std::string line; std::getline(stream, line);) {
    line.erase(std::min(line.find('#'), line.size()));
    const size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string::npos) continue;
    flights.push_back(file.parent_path() / line.substr(begin, line.find_last_not_of(" \t\r") + 1 - begin));
  }
  return flights;
}

// The flights of this shard, in the order they were named.
std::vector<fs::path> flights_to_run(const CommandLine& line) {
  std::vector<fs::path> all(line.arguments.begin(), line.arguments.end());
  if (!FLAGS_manifest.empty()) {
    for (auto& flight : read_manifest(FLAGS_manifest)) all.push_back(std::move(flight));
  }
  if (all.empty()) throw UsageError("expected a flight, or --manifest");
  int k = 0, n = 0, end = 0;
  if (std::sscanf(FLAGS_shard.c_str(), "%d/%d%n", &k, &n, &end) != 2 ||
      end != static_cast<int>(FLAGS_shard.size()) || n < 1 || k < 1 || k > n) {
    throw UsageError("--shard: expected k/n with 1 <= k <= n, found \"" + FLAGS_shard + '"');
  }
  std::vector<fs::path> mine;
  for (size_t i = static_cast<size_t>(k) - 1; i < all.size(); i += static_cast<size_t>(n))
    mine.push_back(all[i]);
  return mine;
}

// OUT/FLIGHTNAME of each flight. Two flights of one name would write over each other.
std::vector<fs::path> output_folders(const std::vector<fs::path>& flights) {
  std::vector<fs::path> folders;
  std::map<std::string, fs::path> taken;
  for (const auto& flight : flights) {
    const std::string name = fs::absolute(flight / "").lexically_normal().parent_path().filename().string();
    if (const auto [it, is_new] = taken.emplace(name, flight); !is_new) {
      throw UsageError(flight.string() + ": has the name of " + it->second.string() +
                       ", which takes the same folder");
    }
    folders.push_back(fs::path(FLAGS_output) / name);
  }
  return folders;
}

// Counts frames: a line that grows on a terminal, nothing elsewhere.
class Progress {
 public:
  void frame() {
    const int64_t frames = ++frames_;
    if (on_terminal_ && frames % 50 == 0) {
      const std::lock_guard lock(mutex_);
      std::cerr << '\r' << frames << " frames" << std::flush;
    }
  }
  void flight(const std::string& text) {
    const std::lock_guard lock(mutex_);
    std::cerr << (on_terminal_ ? "\r" : "") << text << std::endl;
  }

 private:
  const bool on_terminal_ = isatty(STDERR_FILENO) != 0;
  std::atomic<int64_t> frames_ = 0;
  std::mutex mutex_;
};

struct Outcome {
  std::optional<ReportFlight> flight;  // absent: interrupted
  bool failed = true;
};

std::vector<Outcome> run_all(const RunConfig& config, const std::vector<fs::path>& flights,
                             const std::vector<fs::path>& folders) {
  std::vector<Outcome> outcomes(flights.size());
  std::vector<size_t> indices(flights.size());
  for (size_t i = 0; i < indices.size(); ++i) indices[i] = i;
  Progress progress;
  tbb::parallel_for_each(indices, [&](size_t i) {
    if (stop_requested) return;
    try {
      outcomes[i].flight =
          run_flight({config, flights[i], folders[i], stop_requested, [&] { progress.frame(); }});
      outcomes[i].failed = false;
      progress.flight(flights[i].string() + ": done");
    } catch (const Interrupted&) {
    } catch (const std::exception& e) {
      outcomes[i].flight = ReportFlight{failed_flight(folders[i].filename().string(), e.what()), {}};
      progress.flight(std::string("perch-batch: ") + e.what());
    }
  });
  return outcomes;
}

int run(const CommandLine& line) {
  if (FLAGS_config.empty()) throw UsageError("expected --config");
  const Section root = Section::load(FLAGS_config, line.all("set"));
  const RunConfig config = read_run_config(root);
  if (FLAGS_print_config) {
    std::cout << root.resolved();
    return 0;
  }
  if (FLAGS_output.empty()) throw UsageError("expected --output");
  if (!FLAGS_compare.empty() && !fs::is_directory(FLAGS_compare)) {
    throw UsageError("--compare " + FLAGS_compare + ": expected the output folder of an earlier run");
  }
  if (FLAGS_jobs < 0) throw UsageError("--jobs: expected 0 or more, found " + std::to_string(FLAGS_jobs));
  try {
    // Whether the method serves the target; the camera is each flight's own.
    make_detector(config.target, CameraModel::pinhole(500, 500, 320, 240, 641, 481), config.detection);
  } catch (const std::invalid_argument& e) {
    throw ConfigError(FLAGS_config + ": " + e.what());
  }
  const auto flights = flights_to_run(line);
  const auto folders = output_folders(flights);
  fs::create_directories(FLAGS_output);
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);

  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    FLAGS_jobs > 0 ? static_cast<size_t>(FLAGS_jobs) : cores);
  const auto outcomes = run_all(config, flights, folders);

  std::vector<ReportFlight> done;
  std::vector<fs::path> estimated;
  bool failed = stop_requested;
  for (size_t i = 0; i < outcomes.size(); ++i) {
    failed = failed || outcomes[i].failed;
    if (outcomes[i].flight) done.push_back(*outcomes[i].flight);
    if (outcomes[i].failed) continue;
    estimated.push_back(folders[i]);
    std::cout << error_table(outcomes[i].flight->score) << '\n';
  }
  write_run_files(FLAGS_output, done, root.resolved());
  std::cout << "report: " << (fs::path(FLAGS_output) / "report.html").string() << '\n';
  if (!FLAGS_compare.empty()) std::cout << '\n' << compare_runs(FLAGS_output, FLAGS_compare, estimated);
  if (stop_requested)
    std::cerr << "perch-batch: interrupted: what is missing was not begun or not finished\n";
  return failed ? 1 : 0;
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  return perch::run_program(argc, argv,
                            {"perch-batch", "--config C.yaml --output OUT FLIGHT... [flags]",
                             "Re-estimates recorded flights, frame by frame, scores the poses against the "
                             "navigation source and writes\n"
                             "OUT/FLIGHT/{estimates,states,errors}.csv, pad_from_body.tum, summary.json, "
                             "OUT/summary.csv, OUT/report.html."},
                            perch::run);
}
