#pragma once

#include <array>
#include <optional>

#include "perch/geometry/rigid3.h"
#include "perch/pose/linear_seed.h"

namespace perch {

// A plane seen from far is nearly the same picture as its mirror image about the plane that faces the camera:
// the reprojection error has two minima (Schweighofer and Pinz 2006; Collins and Bartoli 2014). With v the
// direction to the target, r1 and r2 keep their parts across v, which the picture shows, and turn over those
// along v. Returns that mirrored pose, from which the refinement finds the second minimum. At v = r3 (seen
// straight on) the two are one.
Rigid3 mirrored_pose(const Rigid3& camera_from_target);

// The two poses whose picture agrees with a view's to first order about its centre (Collins and Bartoli,
// Infinitesimal plane-based pose estimation, 2014). They are each other's mirror image. From far away the
// perspective that the linear seed takes the tilt from drowns in the noise, and it finds tilts of 70 degrees
// where there are 10, from where a descent runs into the flat saddle between the two minima; the first order
// is what remains of the picture. Empty for a mirrored view or one seen edge-on.
std::optional<std::array<Rigid3, 2>> infinitesimal_poses(const PlaneView& view);

}  // namespace perch
