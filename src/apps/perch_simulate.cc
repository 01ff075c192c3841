// perch-simulate: flies a simulated landing and writes it as a recorded flight with exact truth.

#include <gflags/gflags.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <csignal>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <stdexcept>
#include <thread>

#include "perch/simulation/flight_folder.h"
#include "program.h"
#include "progress.h"

DEFINE_string(config, "", "the simulation, a YAML file; see configs/simulation");
DEFINE_string(output, "", "the folder to write the flight into");
DEFINE_string(set, "", "key.path=value in place of what the configuration says; may be given several times");
DEFINE_bool(print_config, false, "print the configuration with every default filled in, and end");
DEFINE_bool(force, false, "replace a flight that perch-simulate wrote before");
DEFINE_int32(jobs, 0, "pictures rendered at a time; 0: as many as the machine has cores");

namespace {

constexpr char kDescription[] =
    R"(Flies a simulated landing on the target and writes it as a recorded flight (an ASL folder) with the exact
truth beside it: the pictures, the navigation source's reports with their errors, the vehicle's true state and
the target's true pose. OUTPUT/perch.yaml is a configuration for perch-batch. The same configuration gives the
same bytes, whatever --jobs.)";

std::atomic<bool> interrupted = false;

int run(const perch::CommandLine& line) {
  if (!line.arguments.empty())
    throw perch::UsageError("expected flags only, found \"" + line.arguments[0] + '"');
  if (FLAGS_config.empty()) throw perch::UsageError("--config: expected a YAML file, found nothing");
  if (FLAGS_jobs < 0) throw perch::UsageError("--jobs: expected 0 or more");
  perch::Section root = perch::Section::load(FLAGS_config, line.all("set"));
  const perch::Simulation simulation = perch::read_simulation(root);
  if (FLAGS_print_config) {
    std::cout << root.resolved();
    return 0;
  }
  if (!simulation.head.empty()) {
    throw perch::ConfigError(FLAGS_config +
                             ": camera.head: expected none, as a head answers to what is seen: perch-live "
                             "with camera.source sim:FILE flies it");
  }
  if (FLAGS_output.empty()) throw perch::UsageError("--output: expected a folder, found nothing");

  perch::FlightFolder folder(FLAGS_output, FLAGS_force);
  std::signal(SIGINT, [](int) { interrupted = true; });
  std::signal(SIGTERM, [](int) { interrupted = true; });
  cv::setNumThreads(1);  // pictures are what runs side by side
  const perch::SimulatedFlight flight(simulation);
  const auto jobs = FLAGS_jobs > 0 ? static_cast<unsigned>(FLAGS_jobs) : std::thread::hardware_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::max(1U, jobs));
  {
    perch::Progress progress;
    std::atomic<int64_t> done = 0;
    tbb::parallel_for(int64_t{0}, flight.frames(), [&](int64_t frame) {
      if (interrupted) return;
      folder.write_frame(flight, frame);
      progress.at(static_cast<double>(++done) / static_cast<double>(flight.frames()), "rendering");
    });
  }
  if (interrupted) throw std::runtime_error("interrupted; nothing is kept");
  folder.write_tables(flight, root.resolved());
  folder.finish();
  std::cout << FLAGS_output << ": " << flight.frames() << " frames\n";
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return perch::run_program(
      argc, argv, {"perch-simulate", "--config SIMULATION.yaml --output FLIGHT [flags]", kDescription}, run);
}
