// perch-calibrate-mount: finds the mount, the pad's place and the clocks' offset from ordinary flights.

#include <gflags/gflags.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <set>

#include "calib/mount/cross_validation.h"
#include "calib/mount/mount_files.h"
#include "calib/mount/mount_report.h"
#include "calib/mount/observability.h"
#include "calib/mount/read_mount.h"
#include "calib/mount/wander.h"
#include "perch/analysis/pad_json.h"
#include "perch/config/atomic_file.h"
#include "perch/geometry/euler.h"
#include "program.h"

DEFINE_string(config, "",
              "the run's configuration, a YAML file; its calibrate_mount section holds priors and noise");
DEFINE_string(output, "", "the file that the mount is written to: a frames section for perch-batch");
DEFINE_string(json, "", "also writes everything that was found, with the covariance, as JSON");
DEFINE_string(report, "", "also writes a page with plots of everything that was found, one HTML file");
DEFINE_string(pad, "per-flight", "per-flight: each flight over its own pad; shared: all over one");
DEFINE_string(offset, "per-flight", "per-flight: each flight has its own clock offset; shared: one for all");
DEFINE_string(set, "", "key.path=value: overrides the configuration; may be given several times");
DEFINE_bool(print_config, false, "prints the configuration with every default, and ends");

namespace perch {
namespace {

std::atomic<bool> stop_requested = false;
void request_stop(int) { stop_requested = true; }

bool is_shared(const std::string& flag, const std::string& value) {
  if (value == "shared") return true;
  if (value == "per-flight") return false;
  throw UsageError("--" + flag + ": expected per-flight or shared, found \"" + value + '"');
}

void print_result(const MountProblem& problem, const MountSolution& s, const std::vector<HeldOut>& held) {
  const Eigen::VectorXd sigma = s.covariance.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    const std::string& name = s.names[static_cast<size_t>(i)];
    const bool angle = name.find("rotation") != std::string::npos;
    const bool time = name.starts_with("time");
    std::printf("  %-28s sigma %9.4f %s\n", name.c_str(), sigma[i] * (angle ? kDegFromRad : 1000),
                angle  ? "deg"
                : time ? "ms"
                       : "mm");
    if (i == 5) break;
  }
  for (const double range : {1.0, 5.0, 10.0}) {
    const MountEffect e = mount_effect(s, problem.chain, range);
    std::printf("  at %4.0f m the mount's uncertainty moves the pad by %.1f mm\n", range, 1000 * e.position);
  }
  for (size_t f = 0; f < problem.flights.size(); ++f) {
    const auto& used = s.flights[f].used;
    std::printf("  %s: %td of %zu pictures, offset %.2f ms, chi-square %.2f a degree of freedom\n",
                problem.flights[f].name.c_str(), std::count(used.begin(), used.end(), true), used.size(),
                1000 * s.state.offsets[offset_of_flight(s.state, f)], s.chi_square / s.degrees);
    const PadScatter before = pad_scatter(problem, s, f, s.start),
                     after = pad_scatter(problem, s, f, s.state);
    const PadScatter all = whole_scatter(problem, s, f);
    std::printf(
        "    the pad as these pictures place it scatters by %.2f mm, %.3f deg RMS, as all %zu do by %.2f mm, "
        "%.3f deg "
        "(with the mount of the start: %.1f mm, %.2f deg)\n",
        1000 * after.position, kDegFromRad * after.rotation, all.count, 1000 * all.position,
        kDegFromRad * all.rotation, 1000 * before.position, kDegFromRad * before.rotation);
  }
  for (const HeldOut& part : held) {
    if (!part.problem.empty()) {
      std::printf("  without a third of the pictures: %s\n", part.problem.c_str());
      continue;
    }
    std::printf("  without a third of the pictures the mount is %.2f mm, %.3f deg away (%.1f sigma)",
                1000 * part.moved, kDegFromRad * part.turned, part.moved_sigmas);
    for (const PadScatter& p : part.beyond) {
      std::printf("; that third places the pad to %.2f mm, %.3f deg", 1000 * p.position,
                  kDegFromRad * p.rotation);
    }
    std::printf("\n");
  }
}

int run(const CommandLine& line) {
  if (FLAGS_config.empty()) throw UsageError("expected --config");
  Section root = Section::load(FLAGS_config, line.all("set"));
  MountOptions options = read_mount_options(root.section("calibrate_mount"));
  const RunConfig config = read_run_config(root);
  if (FLAGS_print_config) {
    std::cout << root.resolved();
    return 0;
  }
  if (FLAGS_output.empty()) throw UsageError("expected --output");
  if (line.arguments.empty()) throw UsageError("expected a flight");
  // Twice the same pictures would tell as if they were twice as many.
  std::set<std::filesystem::path> folders;
  for (const std::string& folder : line.arguments) {
    if (!folders.insert(std::filesystem::weakly_canonical(folder)).second)
      throw UsageError(folder + ": the same flight twice");
  }
  options.shared_pad = is_shared("pad", FLAGS_pad);
  options.shared_offset = is_shared("offset", FLAGS_offset);
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);

  const bool on_terminal = isatty(STDERR_FILENO) != 0;
  MountProblem problem;
  problem.options = options;
  FrameChain frames = config.frames;
  for (const std::string& folder : line.arguments) {
    const ReadFlight read = read_mount_flight(config, folder, [&](size_t frames_done) {
      if (on_terminal && frames_done % 50 == 0) std::cerr << '\r' << frames_done << " pictures" << std::flush;
      return !stop_requested;
    });
    if (stop_requested) throw std::runtime_error("interrupted");
    for (const std::string& what : read.problems) std::cerr << "perch-calibrate-mount: " << what << '\n';
    std::cerr << (on_terminal ? "\r" : "") << folder << ": the target in " << read.flight.sightings.size()
              << " of " << read.pictures << " pictures\n";
    // The drawing: the configuration's, else the first flight's own.
    if (!frames.body_from_base && read.body_from_camera) {
      frames.body_from_base = *read.body_from_camera * inverse(base_from_camera(frames, HeadAngles{}));
    }
    problem.flights.push_back(read.flight);
  }
  problem.chain = mount_chain(frames);
  problem.nominal_mount = nominal_mount(frames);
  problem.nominal_offset = frames.time_offset;
  problem.nominal_pad = frames.world_from_pad;
  const MountSolution solution =
      solve_mount(problem, [](const std::string& text) { std::cerr << text << '\n'; });
  const std::vector<HeldOut> held = cross_validate(problem, solution);
  print_result(problem, solution, held);
  const auto not_told = untold(solution, options);
  for (const Untold& u : not_told) std::cerr << "perch-calibrate-mount: " << in_words(u) << '\n';
  for (size_t f = 0; f < problem.flights.size(); ++f) {
    const std::string words = in_words(wander(problem, solution, f));
    if (!words.empty())
      std::cerr << "perch-calibrate-mount: " << problem.flights[f].name << ": " << words << '\n';
  }
  const FrameChain chain = calibrated_chain(frames, problem, solution);
  if (!FLAGS_json.empty()) {
    write_whole_file(FLAGS_json, mount_json(chain, problem, solution, held).dump(1) + "\n");
  }
  const std::string yaml = mount_yaml(chain, problem, solution);
  if (!FLAGS_report.empty()) {
    write_whole_file(FLAGS_report, mount_report_html(problem, solution, held, yaml,
                                                     pad_json(config.target, problem.chain.pad_from_target)));
  }
  if (!not_told.empty()) {
    throw std::runtime_error(FLAGS_output +
                             " is not written: the flights do not tell the above; what is known "
                             "from elsewhere goes into calibrate_mount.prior, with its deviations");
  }
  write_whole_file(FLAGS_output, yaml);
  std::cout << "mount: " << FLAGS_output << '\n';
  return 0;
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  return perch::run_program(argc, argv,
                            {"perch-calibrate-mount", "--config C.yaml --output mount.yaml FLIGHT... [flags]",
                             "Finds body_from_base, world_from_pad and time_offset (and a pan/tilt head's "
                             "axes) from flights over the\n"
                             "target with navigation, with deviations, and writes them as a frames section. "
                             "Refuses what the flights "
                             "do not tell."},
                            perch::run);
}
