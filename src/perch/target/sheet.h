#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "perch/target/landing_target.h"

namespace perch {

// How a target is laid out on paper. All in mm; on the page x right, y down, origin at the upper left corner.
//
//   +--------------------------+  page
//   |   +------------------+   |
//   | r |                  |   |  window: shows a part of the drawing in true size
//   | u |                  |   |
//   | l +------------------+   |  foot: caption, label
//   |    ruler                 |
//   +--------------------------+
//
// The drawing is the target with a margin for its cut marks; its frame is the target's, in mm, y up.

enum class Paper { kNone, kA4, kA3, kLetter };

struct Size {
  double width = 0, height = 0;
};

// Printers of the last twenty years leave 3 to 5 mm of a sheet white. With 10 mm a pad of 1 m would take 35
// sheets of A4, with this 24.
inline constexpr double kPageMargin = 6;
// Around the target for the marks at its corners; around a tile's window for those that show where to cut it.
inline constexpr double kMarkMargin = 5;
// For the vertical ruler, left of the window; and for ruler and caption, below it.
inline constexpr double kRulerStrip = 10;
inline constexpr double kFoot = 14;
// What neighbouring tiles both show, so that one can be glued onto the other.
inline constexpr double kOverlap = 10;
// What a ruler is long: an office ruler measures it to 0.2 %.
inline constexpr double kRuler = 100;

struct Sheet {
  int row = 0, column = 0;                           // from the upper left, 0 based
  Eigen::Vector2d window = Eigen::Vector2d::Zero();  // its upper left corner on the page
  Size window_size;
  Eigen::Vector2d drawing = Eigen::Vector2d::Zero();  // what of the drawing is at that corner
};

struct SheetPlan {
  Size page;
  int rows = 1, columns = 1;
  std::vector<Sheet> sheets;  // row by row; one: the target is not tiled

  bool tiled() const { return sheets.size() > 1; }
};

// "r1c2": the first row's second.
std::string tile_name(const Sheet& sheet);

// The upright page; {0, 0} for kNone.
Size page_size(Paper paper);

// One sheet as large as need be with kNone; else one page, upright or across, if the drawing fits on it, or
// the fewest tiles.
SheetPlan plan_sheets(const Bounds& target, Paper paper);

}  // namespace perch
