#pragma once

#include <atomic>
#include <filesystem>
#include <iosfwd>
#include <string>

#include "calib/camera/board.h"
#include "calib/camera/calibration.h"

namespace perch {

struct LiveHelpOptions {
  std::string source;          // as camera.source has it
  double until_px = 0.5;       // uncertainty at infinity, on 95 % of where boards were
  std::filesystem::path page;  // empty: none
  std::filesystem::path keep;  // a folder for the pictures taken; empty: none is kept
  double duration = 0;         // s; 0: no end
  const std::atomic<bool>* stop = nullptr;
};

// What is known so far, for whoever holds the board.
struct LiveState {
  int pictures = 0;
  int columns = 0, rows = 0;         // cells of the picture
  std::vector<int> corners_by_cell;  // row by row
  double uncertainty_px = 0;         // NaN: too few pictures for a solve
  double until_px = 0;
  std::vector<std::string> advice;  // what to do next, most needed first
  std::string note;                 // about the picture just seen: "taken", "hold still", "no board"
};

// The cells as characters, a dot for none and # for many corners, the uncertainty and the advice.
std::string live_text(const LiveState& state);
// A page that shows the same, loads itself again every second and needs nothing else.
std::string live_page(const LiveState& state);

// Which pose to add, one sentence each: what the fit says is missing, or, before there is one, the first
// cells that have no corner.
std::vector<std::string> live_advice(const BoardViews& views, const LensFit* fit);

// Takes a picture whenever the board is held still and stands otherwise than in all before, solves with all
// taken so far, tells on `out` what is missing, and ends when the uncertainty asked for is reached, the
// source ends, or it is stopped. Returns what was taken. Throws CalibrationError where that is nothing.
BoardViews help_live(const Board& board, const LiveHelpOptions& options, const CalibrationOptions& solving,
                     std::ostream& out);

}  // namespace perch
