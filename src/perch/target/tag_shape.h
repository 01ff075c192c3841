#pragma once

#include <Eigen/Core>
#include <vector>

#include "perch/target/landing_target.h"
#include "perch/target/tag_family.h"

namespace perch {

// Where the ink of a tag goes, in the tag's own modules: origin at its centre, x right, y up as it is
// printed.
struct TagShape {
  // Painted in this order.
  std::vector<Patch> patches;
  double edge = 0;       // side of the square whose corners libapriltag reports
  double footprint = 0;  // side of all the tag needs but the quiet zone
  double quiet_zone =
      0;  // white margin around the footprint, which the families with a white border do not need
  double free_centre = 0;  // side of the square in the middle that is no part of the code (tagCustom48h12)
};

TagShape tag_shape(const apriltag_family_t& family, int id, int border);

}  // namespace perch
