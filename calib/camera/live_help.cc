#include "calib/camera/live_help.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <iomanip>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "calib/camera/board_finder.h"
#include "calib/camera/coverage.h"
#include "calib/camera/frame_choice.h"
#include "calib/camera/lens_covariance.h"
#include "perch/camera/live_source.h"
#include "perch/config/atomic_file.h"
#include "perch/simulation/live_simulation.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

constexpr int kColumns = 16, kRows = 10;

// Between two pictures the board must have moved less than this part of the picture's width to be held still.
// A recording has no other pictures than it has: of it the blur alone decides.
constexpr double kStill = 0.004;
constexpr double kMostBlur = 1.6;  // px, of edges

constexpr size_t kLeastViews = 4;   // for a solve
constexpr size_t kMostViews = 200;  // solves take seconds by then
constexpr const char* kLens = "LENSMODEL_OPENCV8";
constexpr const char* kLensOfFew = "LENSMODEL_OPENCV4";  // of fewer than 10

std::string number(double value) {
  std::ostringstream text;
  text << std::setprecision(2) << value;
  return std::isfinite(value) ? text.str() : "not known yet";
}

std::unique_ptr<LiveSource> open(const std::string& source) {
  constexpr std::string_view kSimulation = "sim:";
  LiveOptions options;
  options.pace = Pace::kFast;  // of a recording no picture is left out
  if (source.starts_with(kSimulation))
    return open_live_simulation(source.substr(kSimulation.size()), options);
  return open_live_source(source, options);
}

// On 95 % of the places where boards have been, at infinity, in the worst direction.
double uncertainty_of(const BoardViews& views, const Candidate& solved) {
  const SensorMap map = uncertainty_map(solved.fit, solved.covariance, kAtInfinity, kColumns, kRows);
  const std::vector<bool> covered = covered_places(views, kColumns, kRows);
  std::vector<double> values;
  for (size_t i = 0; i < covered.size(); ++i) {
    if (covered[i]) values.push_back(std::isfinite(map.values[i]) ? map.values[i] : INFINITY);
  }
  if (values.empty()) return NAN;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(0.95 * static_cast<double>(values.size() - 1))];
}

struct Solved {
  size_t views = 0;
  double uncertainty_px = NAN;
  std::vector<std::string> advice;
  std::optional<CameraModel> lens;
};

Solved solve(const BoardViews& views, const CalibrationOptions& options) {
  Solved solved{views.views.size(), NAN, {}, {}};
  try {
    const Candidate one = calibrate_once(views, views.views.size() < 10 ? kLensOfFew : kLens, options);
    if (!one.usable()) throw CalibrationError(one.failure);
    solved.uncertainty_px = uncertainty_of(views, one);
    solved.advice = live_advice(views, &one.fit);
    solved.lens = one.fit.model();
  } catch (const CalibrationError& e) {
    solved.advice = live_advice(views, nullptr);
    solved.advice.push_back(e.what());
  }
  return solved;
}

class Session {
 public:
  Session(const Board& board, const LiveHelpOptions& options, const CalibrationOptions& solving,
          std::ostream& out)
      : board_(board), options_(options), solving_(solving), out_(out), finder_(make_board_finder(board)) {
    views_.grid = board.grid;
    state_.until_px = options.until_px;
    state_.uncertainty_px = NAN;
    state_.columns = kColumns;
    state_.rows = kRows;
    state_.advice = {"Hold the board before the camera, still for a moment at a time."};
    terminal_ = isatty(STDERR_FILENO) == 1;
  }

  BoardViews run();

 private:
  bool take(const Frame& frame, bool recorded);
  void keep(BoardView& view, const cv::Mat& grey) const;
  void start_solving();
  bool collect(bool wait);
  void tell();
  bool reached() const {
    return state_.uncertainty_px <= options_.until_px &&
           solved_views_ >= 10;  // of fewer the number itself is unsure
  }

  const Board& board_;
  const LiveHelpOptions& options_;
  const CalibrationOptions& solving_;
  std::ostream& out_;
  std::unique_ptr<BoardFinder> finder_;
  BoardViews views_;
  std::vector<ViewTraits> traits_;
  std::optional<ViewTraits> last_;  // of the picture before
  LiveState state_;
  std::future<Solved> solving_now_;
  size_t solved_views_ = 0;
  bool terminal_ = false, told_ = false;
  std::string told_text_;
};

void Session::keep(BoardView& view, const cv::Mat& grey) const {
  if (options_.keep.empty()) return;
  fs::create_directories(options_.keep);
  char name[40];
  std::snprintf(name, sizeof name, "board_%03d.png", static_cast<int>(views_.views.size()) % 1000);
  const fs::path file = options_.keep / name;
  if (!cv::imwrite(file.string(), grey)) throw std::runtime_error(file.string() + ": cannot be written");
  view.picture = file.string();
}

// Whether the picture was taken; state_.note says why or why not.
bool Session::take(const Frame& frame, bool recorded) {
  if (!frame.problem.empty()) {
    state_.note = frame.problem;
    return false;
  }
  FoundBoard found{frame.name, frame.grey.cols, frame.grey.rows, finder_->find(frame.grey)};
  if (found.sighting.corners.empty()) {
    state_.note = found.sighting.problem;
    last_.reset();
    return false;
  }
  if (views_.width == 0) std::tie(views_.width, views_.height) = std::pair(frame.grey.cols, frame.grey.rows);
  if (frame.grey.cols != views_.width || frame.grey.rows != views_.height) {
    state_.note = "a picture of another size than those before";
    return false;
  }
  const ViewTraits traits = view_traits(found, board_.grid);
  const bool still = recorded || (last_ && (traits - *last_).norm() < kStill);
  last_ = traits;
  if (!still || found.sighting.blur_px > kMostBlur) {
    state_.note = "hold still";
    return false;
  }
  const bool distinct = std::all_of(traits_.begin(), traits_.end(), [&](const ViewTraits& other) {
    return (traits - other).norm() > kDistinct;
  });
  if (!distinct) {
    state_.note = "like one before: move the board";
    return false;
  }
  BoardView view{frame.name, std::move(found.sighting.corners)};
  keep(view, frame.grey);
  views_.views.push_back(std::move(view));
  traits_.push_back(traits);
  state_.pictures = static_cast<int>(views_.views.size());
  state_.corners_by_cell = corners_by_cell(views_, kColumns, kRows);
  state_.note = "taken";
  return true;
}

// In a thread of its own, with a copy of what there is: the next pictures do not wait.
void Session::start_solving() {
  if (solving_now_.valid() || views_.views.size() < kLeastViews || views_.views.size() == solved_views_)
    return;
  solving_now_ =
      std::async(std::launch::async, [views = views_, options = solving_] { return solve(views, options); });
}

bool Session::collect(bool wait) {
  if (!solving_now_.valid()) return false;
  if (!wait && solving_now_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  Solved solved = solving_now_.get();
  solved_views_ = solved.views;
  state_.uncertainty_px = solved.uncertainty_px;
  state_.advice = std::move(solved.advice);
  // A landing target of squares is found better through the lens.
  if (solved.lens) finder_ = make_board_finder(board_, solved.lens);
  return true;
}

void Session::tell() {
  const std::string text = live_text(state_);
  if (!options_.page.empty()) write_whole_file(options_.page, live_page(state_));
  if (terminal_ && told_) {
    const auto lines = std::count(told_text_.begin(), told_text_.end(), '\n');
    out_ << "\x1b[" << lines << "A\x1b[J";  // up, and everything below away
  }
  out_ << text << std::flush;
  told_ = true;
  told_text_ = text;
}

BoardViews Session::run() {
  using Clock = std::chrono::steady_clock;
  const auto pictures = open(options_.source);
  const bool recorded = options_.source.starts_with("flight:") || options_.source.starts_with("images:") ||
                        options_.source.starts_with("video:") || options_.source.starts_with("sim:");
  const auto start = Clock::now();
  auto told_at = start - std::chrono::seconds(10);
  tell();
  while (!(options_.stop && *options_.stop)) {
    const auto frame = pictures->next(std::chrono::milliseconds(200));
    bool changed = frame && take(frame->frame, recorded);
    if (!frame) state_.note = pictures->ended() ? "the source has ended" : "no picture from the source";
    start_solving();
    changed = collect(false) || changed;
    const auto now = Clock::now();
    // The note changes with every picture: a terminal follows it, a log does not.
    if (changed || (terminal_ && now - told_at > std::chrono::milliseconds(300))) {
      tell();
      told_at = now;
    }
    if (reached() || pictures->ended() || views_.views.size() >= kMostViews) break;
    if (options_.duration > 0 && std::chrono::duration<double>(now - start).count() > options_.duration)
      break;
  }
  collect(true);
  start_solving();
  if (collect(true)) tell();
  if (views_.views.empty())
    throw CalibrationError(options_.source + ": no picture showed the " + board_.text);
  out_ << (reached() ? "The uncertainty asked for is reached.\n"
                     : "Ended before the uncertainty asked for.\n");
  return std::move(views_);
}

const char* where(int cell, int cells, const char* low, const char* middle, const char* high) {
  return cell * 3 < cells ? low : cell * 3 < 2 * cells ? middle : high;
}

}  // namespace

std::vector<std::string> live_advice(const BoardViews& views, const LensFit* fit) {
  if (fit) return what_is_missing(views, *fit);
  // Nine parts of the picture; those nearest to the rim are what a lens is known least by.
  std::vector<std::string> advice;
  const std::vector<int> corners = corners_by_cell(views, 3, 3);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if (corners[static_cast<size_t>(3 * row + column)] > 0) continue;
      advice.push_back(std::string("No board yet ") +
                       where(row, 3, "at the top", "in the middle", "at the bottom") +
                       where(column, 3, ", left", "", ", right") + " of the picture: hold it there.");
    }
  }
  advice.push_back("Tilt the board by 20 to 45 degrees, a different way each time.");
  return advice;
}

std::string live_text(const LiveState& state) {
  std::ostringstream text;
  const std::string line(static_cast<size_t>(state.columns), '-');
  text << '+' << line << "+\n";
  for (int row = 0; row < state.rows; ++row) {
    text << '|';
    for (int column = 0; column < state.columns; ++column) {
      const auto i = static_cast<size_t>(row * state.columns + column);
      const int corners = i < state.corners_by_cell.size() ? state.corners_by_cell[i] : 0;
      text << (corners == 0 ? '.' : corners < 5 ? '-' : corners < 15 ? '+' : '#');
    }
    text << "|\n";
  }
  text << '+' << line << "+  " << state.pictures << " pictures; uncertainty " << number(state.uncertainty_px)
       << (std::isfinite(state.uncertainty_px) ? " px" : "") << ", asked for " << number(state.until_px)
       << " px\n"
       << "now: " << state.note << '\n';
  for (size_t i = 0; i < std::min<size_t>(3, state.advice.size()); ++i)
    text << "next: " << state.advice[i] << '\n';
  return text.str();
}

std::string live_page(const LiveState& state) {
  const auto escaped = [](const std::string& text) {
    std::string safe;
    for (const char c : text) safe += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
    return safe;
  };
  constexpr int kCell = 40;  // px
  std::ostringstream page;
  page << "<!doctype html><meta charset=\"utf-8\"><meta http-equiv=\"refresh\" "
          "content=\"1\"><title>Calibration</title>"
          "<style>body{font:18px sans-serif;margin:2em;background:#111;color:#eee}b{font-size:150%}</style>\n"
       << "<p><b>" << escaped(state.note) << "</b><p>" << state.pictures << " pictures, uncertainty "
       << number(state.uncertainty_px) << ", asked for " << number(state.until_px) << " px\n<p><svg width=\""
       << state.columns * kCell << "\" height=\"" << state.rows * kCell << "\">";
  for (int row = 0; row < state.rows; ++row) {
    for (int column = 0; column < state.columns; ++column) {
      const auto i = static_cast<size_t>(row * state.columns + column);
      const int corners = i < state.corners_by_cell.size() ? state.corners_by_cell[i] : 0;
      page << "<rect x=\"" << column * kCell << "\" y=\"" << row * kCell << "\" width=\"" << kCell - 1
           << "\" height=\"" << kCell - 1 << "\" fill=\""
           << (corners == 0   ? "#622"
               : corners < 5  ? "#553"
               : corners < 15 ? "#353"
                              : "#2a4")
           << "\"/>";
    }
  }
  page << "</svg>\n<ul>";
  for (const std::string& advice : state.advice) page << "<li>" << escaped(advice) << "</li>\n";
  page << "</ul>\n";
  return page.str();
}

BoardViews help_live(const Board& board, const LiveHelpOptions& options, const CalibrationOptions& solving,
                     std::ostream& out) {
  return Session(board, options, solving, out).run();
}

}  // namespace perch
