// perch-calibrate-camera: a camera's model from pictures of a board or of the landing target, and how far to
// trust it.

#include <gflags/gflags.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <thread>

#include "calib/camera/calibration_json.h"
#include "calib/camera/calibration_report.h"
#include "calib/camera/camera_model_file.h"
#include "calib/camera/find_boards.h"
#include "calib/camera/live_help.h"
#include "calib/camera/verdict.h"
#include "perch/camera/zoom_table.h"
#include "perch/config/error.h"
#include "program.h"
#include "progress.h"

DEFINE_string(board, "",
              "the board: inner corners of a chessboard (9x6), or charuco: and its squares (charuco:10x7)");
DEFINE_double(spacing, 0, "distance of the board's corners, m");
DEFINE_double(marker, 0, "side of a ChArUco board's markers, m");
DEFINE_string(dictionary, "4X4_50", "of a ChArUco board, as OpenCV names it");
DEFINE_string(target, "", "in place of --board: a landing target's YAML, or a Kalibr AprilGrid's");
DEFINE_string(output, "", "the camera model to write (.cameramodel); empty: only look for the board");
DEFINE_string(json, "", "a summary for programs");
DEFINE_string(report, "", "a page (.html) with the verdict and pictures of what it rests on");
DEFINE_string(lens, "", "mrcal's lens models to compare, by commas (LENSMODEL_OPENCV4,LENSMODEL_OPENCV8)");
DEFINE_string(require, "",
              "thresholds, exit 1 where one is not met: uncertainty_px=0.5,coverage=0.8 or recommended");
DEFINE_string(ranges, "1,5,10", "landing ranges to judge at, m");
DEFINE_string(landing_target, "", "whose landing is judged; empty: --target, or the sharp target of 1 m");
DEFINE_string(show, "", "a folder for the pictures with their corners drawn in order");
DEFINE_bool(cache, true, "keep the corners found beside the pictures (perch-corners.json)");
DEFINE_int32(frames, 60, "frames chosen of a video or a flight, at most");
DEFINE_double(zoom, NAN, "the zoom at which the pictures were taken, for --zoom-table");
DEFINE_string(zoom_table, "", "the table of a zoom camera's models to add this one to");
DEFINE_string(live, "",
              "help while taking the pictures: v4l2:DEV, gst:PIPELINE, sim:FILE.yaml, flight:FOLDER ...");
DEFINE_double(until, 0.5,
              "with --live: the uncertainty at infinity to stop at, px, on 95 % of where boards were");
DEFINE_string(page, "", "with --live: a page (.html) that shows the same and renews itself");
DEFINE_string(keep, "", "with --live: the folder for the pictures taken; empty: none is kept");
DEFINE_double(duration, 0, "with --live: stop after so many seconds at the latest; 0: never");
DEFINE_int32(jobs, 0, "pictures looked at at a time; 0: as many as the machine has cores");

namespace perch {
namespace {

constexpr char kDescription[] =
    R"(Calibrates a camera from pictures of a chessboard, a ChArUco board, a Kalibr AprilGrid or the landing target
itself, and says how far the result can be trusted to land by. Pictures are files, globs, folders, videos or recorded
flights; of the latter two it chooses sharp and distinct frames by itself. With --live it says, while the board is
moved before the camera, where to hold it next. docs/CALIBRATE_CAMERA.md has the whole procedure.)";

// What the landing error is told of where nobody names a target: the sharp one.
constexpr char kSharp[] = R"(name: sharp
size: 1
modules: 20
border: 3
squares: {A: [10, 10, 5], B: [5, 13, 2], C: [5, 9, 2], D: [5, 5, 2], E: [9, 5, 2], F: [13, 5, 2]}
)";

std::atomic<bool> interrupted = false;

std::vector<std::string> by_commas(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) {
    if (!part.empty()) parts.push_back(part);
  }
  return parts;
}

std::vector<double> ranges_of(const std::string& text) {
  std::vector<double> ranges;
  for (const std::string& part : by_commas(text)) {
    std::istringstream number(part);
    double range = 0;
    if (!(number >> range) || !number.eof() || !(range > 0)) {
      throw UsageError("--ranges: expected lengths above 0 in m by commas, found \"" + text + '"');
    }
    ranges.push_back(range);
  }
  return ranges;
}

Board board_of_flags() {
  if (FLAGS_board.empty() == FLAGS_target.empty()) throw UsageError("expected either --board or --target");
  if (!FLAGS_target.empty()) return read_board(FLAGS_target);
  try {
    const bool charuco = FLAGS_board.starts_with("charuco:");
    return parse_board(FLAGS_board, FLAGS_spacing, charuco ? FLAGS_marker : 0,
                       charuco ? FLAGS_dictionary : "");
  } catch (const std::invalid_argument& e) {
    throw UsageError(std::string("--board: ") + e.what());
  }
}

LandingTarget landing_target(const Board& board) {
  if (!FLAGS_landing_target.empty()) return read_target(FLAGS_landing_target);
  if (const auto* target = std::get_if<TargetBoard>(&board.pattern)) return target->target;
  return read_target(Section::parse(kSharp, "sharp.yaml"));
}

// Said before the work of minutes, not after it.
void check_writable(const char* flag, const std::string& file) {
  if (file.empty()) return;
  const std::filesystem::path parent = std::filesystem::absolute(file).parent_path();
  if (access(parent.c_str(), W_OK) != 0)
    throw std::runtime_error(std::string(flag) + ": " + parent.string() + ": " + std::strerror(errno));
}

void check_flags(const CommandLine& line) {
  if (FLAGS_live.empty() == line.arguments.empty()) throw UsageError("expected pictures, or --live and none");
  if (FLAGS_frames < 3) throw UsageError("--frames: expected 3 or more");
  if (FLAGS_jobs < 0) throw UsageError("--jobs: expected 0 or more");
  if (std::isfinite(FLAGS_zoom) == FLAGS_zoom_table.empty())
    throw UsageError("--zoom and --zoom-table go together");
  const bool writes =
      !FLAGS_json.empty() || !FLAGS_report.empty() || !FLAGS_zoom_table.empty() || !FLAGS_require.empty();
  if (FLAGS_output.empty() && writes) throw UsageError("--output: expected the file for the camera model");
  check_writable("--output", FLAGS_output);
  check_writable("--json", FLAGS_json);
  check_writable("--report", FLAGS_report);
  check_writable("--zoom-table", FLAGS_zoom_table);
}

void tell(const FoundBoards& found) {
  for (const LeftOut& one : found.left_out)
    std::cerr << "left out: " << one.picture << ": " << one.reason << '\n';
  for (const std::string& remark : found.remarks) std::cerr << remark << '\n';
  size_t corners = 0;
  for (const BoardView& view : found.views.views) corners += view.corners.size();
  std::cout << found.views.views.size() << (found.views.views.size() == 1 ? " picture of " : " pictures of ")
            << found.views.width << "x" << found.views.height << " with " << corners << " corners\n";
}

// A landing target of squares is measured through the lens: once it is known roughly, it is measured again.
FoundBoards find(const Board& board, const PictureList& pictures, const CalibrationOptions& solving) {
  FindOptions options;
  options.cache = FLAGS_cache;
  options.show = FLAGS_show;
  options.most_frames = static_cast<size_t>(FLAGS_frames);
  options.stop = &interrupted;
  Progress progress;
  const FindProgress tell_progress = [&](double part, const std::string& what) { progress.at(part, what); };
  FoundBoards found = find_boards(board, pictures, options, tell_progress);
  const auto* target = std::get_if<TargetBoard>(&board.pattern);
  if (!target || target->edges.edges.empty()) return found;
  for (int round = 0; round < 2; ++round) {
    const char* lens = found.views.views.size() < 10 ? "LENSMODEL_OPENCV4" : "LENSMODEL_OPENCV8";
    Candidate rough;
    try {
      rough = calibrate_once(found.views, lens, solving);
    } catch (const CalibrationError& e) {
      found.remarks.push_back(std::string("measured without a lens: ") + e.what());
      return found;
    }
    if (!rough.usable()) return found;
    options.lens = rough.fit.model();
    found = find_boards(board, pictures, options, tell_progress);
  }
  return found;
}

// How well the table says what is between its zooms, by those that have one on either side.
void add_to_table() {
  if (add_to_zoom_table(FLAGS_zoom_table, FLAGS_zoom, FLAGS_output) < 2) {
    std::cout << FLAGS_zoom_table << ": the first zoom; a table needs two\n";
    return;
  }
  const ZoomTable table = read_zoom_table(FLAGS_zoom_table);
  const std::vector<double> held_out = table.held_out_px();
  for (size_t i = 0; i < held_out.size(); ++i) {
    std::cout << FLAGS_zoom_table << ": without zoom " << table.entries()[i + 1].zoom
              << " its neighbours put what it sees up to " << held_out[i] << " px elsewhere\n";
  }
}

int finish(const Board& board, const BoardViews& views, const CalibrationOptions& options) {
  Calibration calibration;
  {
    Progress progress;
    calibration = calibrate_camera(views, options,
                                   [&](double part, const std::string& what) { progress.at(part, what); });
  }
  const Verdict verdict = judge(views, calibration, landing_target(board));
  write_camera_model(FLAGS_output, views, calibration.best());
  if (!FLAGS_json.empty()) write_calibration_json(FLAGS_json, views, calibration, verdict);
  if (!FLAGS_report.empty())
    write_calibration_report(FLAGS_report, views, calibration, verdict, FLAGS_output);
  if (!FLAGS_zoom_table.empty()) add_to_table();
  for (const std::string& remark : calibration.remarks) std::cerr << remark << '\n';
  std::cout << verdict.summary << '\n' << calibration.why << '\n';
  for (const std::string& warning : verdict.warnings) std::cout << "warning: " << warning << '\n';
  for (const SuspectView& view : verdict.suspects)
    std::cout << views.views[view.view].picture << ": " << view.why << '\n';
  for (const std::string& missing : verdict.missing) std::cout << "missing: " << missing << '\n';
  std::cout << FLAGS_output << ": " << calibration.fit().lens << '\n';
  int code = 0;
  if (!FLAGS_require.empty()) {
    for (const Gate& gate : check(verdict, calibration, parse_requirements(FLAGS_require))) {
      if (gate.met) continue;
      std::cerr << "not met: " << in_words(gate) << '\n';
      code = 1;
    }
  }
  return code;
}

BoardViews live(const Board& board, const CalibrationOptions& solving) {
  LiveHelpOptions options;
  options.source = FLAGS_live;
  options.until_px = FLAGS_until;
  options.page = FLAGS_page;
  options.keep = FLAGS_keep;
  options.duration = FLAGS_duration;
  options.stop = &interrupted;
  return help_live(board, options, solving, std::cerr);
}

int run(const CommandLine& line) {
  check_flags(line);
  CalibrationOptions options;
  if (!FLAGS_lens.empty()) options.lens_models = by_commas(FLAGS_lens);
  options.ranges = ranges_of(FLAGS_ranges);
  try {
    for (const std::string& lens : options.lens_models) check_lens(lens);
  } catch (const CalibrationError& e) {
    throw UsageError(std::string("--lens: ") + e.what());
  }
  if (!FLAGS_require.empty()) {
    try {
      parse_requirements(FLAGS_require);
    } catch (const CalibrationError& e) {
      throw UsageError(e.what());
    }
  }
  const Board board = board_of_flags();
  const auto jobs = FLAGS_jobs > 0 ? static_cast<unsigned>(FLAGS_jobs) : std::thread::hardware_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::max(1U, jobs));
  std::signal(SIGINT, [](int) { interrupted = true; });
  std::signal(SIGTERM, [](int) { interrupted = true; });
  BoardViews views;
  if (FLAGS_live.empty()) {
    const FoundBoards found = find(board, list_pictures(line.arguments), options);
    tell(found);
    views = found.views;
  } else {
    views = live(board, options);
  }
  if (FLAGS_output.empty()) return 0;
  return finish(board, views, options);
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  return perch::run_program(
      argc, argv,
      {"perch-calibrate-camera", "--board 9x6 --spacing 0.025 --output cam.cameramodel PICTURE… [flags]",
       perch::kDescription},
      perch::run);
}
