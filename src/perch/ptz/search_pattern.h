#pragma once

#include "perch/frames/frame_chain.h"
#include "perch/ptz/head_model.h"

namespace perch {

// Where to look for a target that is lost, second by second: a spiral about where it should be, whose turns
// overlap by a third of the picture, then all that the head reaches, row by row, again and again.
//
//   spiral r = pitch theta / 2 pi at constant speed along the path:  theta(t) = sqrt(4 pi speed t / pitch)
class SearchPattern {
 public:
  // `view`: the smaller angle of the picture, rad.
  SearchPattern(const HeadModel& model, double view);

  // `expected`: where the target should be now.
  HeadAngles at(double since_lost, const HeadAngles& expected) const;
  double spiral_duration() const;

 private:
  HeadAngles row_by_row(double t) const;

  HeadModel model_;
  double pitch_;   // between two turns, or two rows, rad
  double speed_;   // rad/s
  double radius_;  // of the whole spiral, rad
};

}  // namespace perch
