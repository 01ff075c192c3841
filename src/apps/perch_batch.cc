// perch-batch: re-estimates recorded flights, scores them against navigation and writes the report.

#include <gflags/gflags.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <opencv2/core/utility.hpp>
#include <sstream>
#include <thread>

#include "batch_compare.h"
#include "batch_flight.h"
#include "batch_folder.h"
#include "batch_season.h"
#include "perch/analysis/report.h"
#include "program.h"
#include "progress.h"

DEFINE_string(config, "", "the run's configuration, a YAML file");
DEFINE_string(output, "", "the folder that the results are written to");
DEFINE_int32(jobs, 0, "how many threads; 0: as many as there are cores");
DEFINE_string(shard, "1/1",
              "k/n: only every n-th flight, beginning with the k-th, and no report: the same command without "
              "--shard finds all shards' flights finished and writes it");
DEFINE_bool(times, true,
            "measured times are among the results; without them two runs' are equal to the byte");
DEFINE_string(manifest, "", "a file that names a flight a line, relative to itself; # begins a comment");
DEFINE_string(
    compare, "",
    "the output of an earlier run: says what changed against it, and exits with 3 if something is worse; "
    "--compare A B alone compares two runs that are there");
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

struct Shard {
  size_t k = 1, n = 1;
};

Shard read_shard() {
  int k = 0, n = 0, end = 0;
  if (std::sscanf(FLAGS_shard.c_str(), "%d/%d%n", &k, &n, &end) != 2 ||
      end != static_cast<int>(FLAGS_shard.size()) || n < 1 || k < 1 || k > n) {
    throw UsageError("--shard: expected k/n with 1 <= k <= n, found \"" + FLAGS_shard + '"');
  }
  return {static_cast<size_t>(k), static_cast<size_t>(n)};
}

struct NamedFlight {
  fs::path folder;
  std::string name;  // of OUT/FLIGHTNAME
};

std::string name_of(const fs::path& flight) {
  return fs::absolute(flight / "").lexically_normal().parent_path().filename().string();
}

// All flights in the order they were given. Two of one name would write over each other, whatever their
// shards.
std::vector<NamedFlight> named_flights(const CommandLine& line) {
  std::vector<fs::path> all(line.arguments.begin(), line.arguments.end());
  if (!FLAGS_manifest.empty()) {
    for (auto& flight : read_manifest(FLAGS_manifest)) all.push_back(std::move(flight));
  }
  if (all.empty()) throw UsageError("expected a flight, or --manifest");
  std::vector<NamedFlight> flights;
  std::map<std::string, fs::path> taken;
  for (const auto& folder : all) {
    const std::string name = name_of(folder);
    if (const auto [it, is_new] = taken.emplace(name, folder); !is_new) {
      throw UsageError(folder.string() + ": has the name of " + it->second.string() +
                       ", which takes the same folder");
    }
    std::error_code ignored;
    if (fs::equivalent(folder, fs::path(FLAGS_output) / name, ignored)) {
      throw UsageError("--output " + FLAGS_output + ": would write into the flight " + folder.string());
    }
    flights.push_back({folder, name});
  }
  return flights;
}

std::vector<NamedFlight> of_shard(const std::vector<NamedFlight>& all, const Shard& shard) {
  std::vector<NamedFlight> mine;
  for (size_t i = shard.k - 1; i < all.size(); i += shard.n) mine.push_back(all[i]);
  return mine;
}

// How many of the flights are done, parts of one counted.
class FlightProgress {
 public:
  explicit FlightProgress(size_t flights) : flights_(static_cast<double>(flights)) {}
  void add(double flight) { shown_.at((done_ += flight) / flights_, "flights"); }
  void tell(const std::string& line) { shown_.tell(line); }

 private:
  const double flights_;
  std::atomic<double> done_ = 0;
  Progress shown_;
};

struct Outcome {
  enum { kMissing, kDone, kFinishedBefore, kFailed } kind = kMissing;
  std::string text;  // the errors, or why it failed
};

Outcome run_one(const BatchFolder& folder, const NamedFlight& flight, const RunConfig& config,
                const std::string& resolved, BatchKey key, FlightProgress& progress) {
  key.flight = flight_digest(flight.folder);
  if (folder.is_finished(flight.name, key)) {
    progress.add(1);
    return {Outcome::kFinishedBefore, {}};
  }
  try {
    std::string errors = run_flight({config, resolved, FLAGS_times, flight.folder, folder.begin(flight.name),
                                     stop_requested, [&](double part) { progress.add(part); }});
    folder.finish(flight.name, key);
    progress.tell(flight.folder.string() + ": done");
    return {Outcome::kDone, std::move(errors)};
  } catch (const Interrupted&) {
    return {};
  } catch (const std::exception& e) {
    folder.forget(flight.name);
    progress.tell(std::string("perch-batch: ") + e.what());
    return {Outcome::kFailed, e.what()};
  }
}

// Each thread takes a flight after the other, in their order; one that finds none left helps with the frames
// of those that are still worked on.
std::vector<Outcome> run_all(const BatchFolder& folder, const std::vector<NamedFlight>& flights,
                             const RunConfig& config, const std::string& resolved, const BatchKey& key,
                             size_t threads) {
  std::vector<Outcome> outcomes(flights.size());
  std::atomic<size_t> next = 0;
  FlightProgress progress(flights.size());
  tbb::parallel_for(
      size_t{0}, std::min(threads, flights.size()),
      [&](size_t) {
        for (size_t i; !stop_requested && (i = next++) < flights.size();)
          outcomes[i] = run_one(folder, flights[i], config, resolved, key, progress);
      },
      tbb::simple_partitioner());
  return outcomes;
}

void check(const RunConfig& config) {
  try {
    // Whether the method serves the target; the camera is each flight's own.
    make_detector(config.target, CameraModel::pinhole(500, 500, 320, 240, 641, 481), config.detection);
  } catch (const std::invalid_argument& e) {
    throw ConfigError(FLAGS_config + ": " + e.what());
  }
}

// What a zoom table's files came to: its path says nothing of them.
std::string lenses_of(const RunConfig& config) {
  std::ostringstream text;
  text.precision(17);
  if (!config.zoom_table) return "";
  for (const ZoomEntry& entry : config.zoom_table->entries()) {
    const CameraModel& model = entry.model;
    text << '\n' << entry.zoom << ' ' << model.lens() << ' ' << model.width() << ' ' << model.height();
    for (const double value : model.intrinsics()) text << ' ' << value;
    text << ' ' << model.intrinsics_covariance();
  }
  return text.str();
}

// All that a flight's results depend on but the flight.
BatchKey key_of(const RunConfig& config, Section root) {
  fs::path target;
  root.read("target", target);
  std::vector<fs::path> files = {target};
  if (!config.camera_model.empty()) files.push_back(config.camera_model);
  const std::string times = FLAGS_times ? "" : "\n--notimes";
  return {program_digest(), configuration_digest(root.resolved() + lenses_of(config) + times, files), {}};
}

constexpr int kWorse = 3;  // exit code: all was done, and the comparison says that something became worse

bool compare(const fs::path& a, const fs::path& b, const std::vector<std::string>& flights) {
  const RunComparison comparison = compare_runs(a, b, flights);
  std::cout << '\n' << comparison.text;
  return comparison.worse;
}

void expect_run(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw UsageError("--compare " + folder.string() + ": expected the output folder of an earlier run");
  }
}

// --compare A B alone: of two runs that are there.
int compare_only(const fs::path& a, const fs::path& b) {
  expect_run(a);
  expect_run(b);
  const auto of_a = flights_of_run(a), of_b = flights_of_run(b);
  std::vector<std::string> all;
  std::set_union(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(), std::back_inserter(all));
  return compare(a, b, all) ? kWorse : 0;
}

// Says what came of it, and writes what is of all flights. Returns the exit code.
int report(const BatchFolder& folder, const std::vector<NamedFlight>& flights,
           const std::vector<Outcome>& outcomes, const Shard& shard, const std::string& resolved) {
  std::vector<SeasonFlight> season;
  std::vector<std::string> compared;  // those that failed, too
  std::array<size_t, 4> counts{};
  for (size_t i = 0; i < flights.size(); ++i) {
    const Outcome& outcome = outcomes[i];
    ++counts[outcome.kind];
    if (outcome.kind == Outcome::kMissing) continue;
    const bool failed = outcome.kind == Outcome::kFailed;
    season.push_back({flights[i].name, failed ? std::optional(outcome.text) : std::nullopt});
    compared.push_back(flights[i].name);
    if (outcome.kind == Outcome::kDone) std::cout << outcome.text << '\n';
  }
  if (counts[Outcome::kFinishedBefore] > 0)
    std::cout << counts[Outcome::kFinishedBefore] << " of " << flights.size() << " flights finished before\n";
  if (shard.n == 1) {
    write_season(folder, season, resolved, FLAGS_compare);
    std::cout << "report: " << (folder.path() / "report.html").string() << '\n';
  }
  const bool worse = !FLAGS_compare.empty() && compare(FLAGS_compare, folder.path(), compared);
  if (counts[Outcome::kMissing] > 0)
    std::cerr << "perch-batch: interrupted: what is missing was not begun or not finished\n";
  return counts[Outcome::kMissing] + counts[Outcome::kFailed] > 0 ? 1 : worse ? kWorse : 0;
}

int run(const CommandLine& line) {
  if (!FLAGS_compare.empty() && FLAGS_config.empty() && FLAGS_output.empty() && line.arguments.size() == 1)
    return compare_only(FLAGS_compare, line.arguments[0]);
  if (FLAGS_config.empty()) throw UsageError("expected --config");
  const Section root = Section::load(FLAGS_config, line.all("set"));
  const RunConfig config = read_run_config(root);
  if (FLAGS_print_config) {
    std::cout << root.resolved();
    return 0;
  }
  if (FLAGS_output.empty()) throw UsageError("expected --output");
  if (!FLAGS_compare.empty()) expect_run(FLAGS_compare);
  if (FLAGS_jobs < 0) throw UsageError("--jobs: expected 0 or more, found " + std::to_string(FLAGS_jobs));
  std::error_code ignored;
  if (!FLAGS_compare.empty() && fs::equivalent(FLAGS_compare, FLAGS_output, ignored)) {
    throw UsageError("--compare " + FLAGS_compare + ": expected another folder than --output");
  }
  check(config);
  const Shard shard = read_shard();
  if (shard.n > 1 && !FLAGS_compare.empty()) {
    throw UsageError("--compare: expected no --shard: it needs all flights");
  }
  const auto flights = named_flights(line);
  const BatchKey key = key_of(config, root);
  const std::string resolved = root.resolved();
  const BatchFolder folder(FLAGS_output);
  folder.share(kReportScript, report_script());
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);

  cv::setNumThreads(1);  // flights and pictures are what runs side by side
  const size_t threads =
      FLAGS_jobs > 0 ? static_cast<size_t>(FLAGS_jobs) : std::max(1U, std::thread::hardware_concurrency());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  const auto mine = of_shard(flights, shard);
  const auto outcomes = run_all(folder, mine, config, resolved, key, threads);
  return report(folder, mine, outcomes, shard, resolved);
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  return perch::run_program(
      argc, argv,
      {"perch-batch", "--config C.yaml --output OUT FLIGHT... [flags]",
       "Re-estimates recorded flights, frame by frame, scores the poses against the "
       "navigation source and writes\n"
       "OUT/FLIGHT/{estimates,states,errors}.csv, pad_from_body.tum, summary.json, "
       "report.html, OUT/summary.csv,\nOUT/report.html and OUT/results.sqlite. Flights "
       "that are finished there, of the same files, configuration and program,\nare not "
       "done again."},
      perch::run);
}
