#pragma once

#include "perch/geometry/rigid3.h"

namespace perch {

// A plane seen from far is nearly the same picture as its mirror image about the plane that faces the camera:
// the reprojection error has two minima (Schweighofer and Pinz 2006; Collins and Bartoli 2014). With v the
// direction to the target, r1 and r2 keep their parts across v, which the picture shows, and turn over those
// along v. Returns that mirrored pose, from which the refinement finds the second minimum. At v = r3 (seen
// straight on) the two are one.
Rigid3 mirrored_pose(const Rigid3& camera_from_target);

}  // namespace perch
