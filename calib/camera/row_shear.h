#pragma once

#include "calib/camera/board_view.h"
#include "calib/camera/lens_fit.h"

namespace perch {

// A rolling shutter reads a row after the other while camera or board moves: what is seen in row y is shifted
// by v (y / height), with a v that is each picture's own. In a view's errors e, whose board's pose has taken
// up what looks like a pose,
//
//   e = J dpose + S v + noise,   S = [y 0; 0 y] / height,
//
// v is found by least squares, and e'e falls by `gain` sigma^2: of noise alone chi squared with two degrees
// of freedom. Half of the pictures move by more than the medians below, so that one wrong picture is none.
//
// A board seen head-on is sheared alike by anything linear; whoever says "rolling shutter" must know that the
// lens model fits.
struct RowShear {
  int views = 0;           // of which it could be found
  double shift_px = 0;     // |v|, median: from the top of the picture to its bottom
  double median_gain = 0;  // of noise alone 1.39, give or take 2 / sqrt(views)
  bool shows() const;
};

RowShear row_shear(const BoardViews& views, const LensFit& fit);

}  // namespace perch
