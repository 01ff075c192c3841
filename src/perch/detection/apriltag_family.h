#pragma once

#include <apriltag/apriltag.h>

#include <memory>
#include <string>

namespace perch {

// libapriltag's table of one tag family, owned.
using AprilTagFamily = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)>;

// The family libapriltag knows by this name ("tag36h11"), its black border `border` modules wide.
// libapriltag's own have one module, Kalibr's AprilGrids two: the same codes, moved inwards.
//
//      border 1        border 2        # black border, . data; outside of both one module of white
//      ########        ##########
//      #......#        ##########
//      #......#        ##......##
//
// Throws std::invalid_argument for a name libapriltag does not know, a border below one module, and a border
// other than 1 of a family whose data lie outside of the border (tagStandard, tagCircle, tagCustom): there is
// no room for it.
AprilTagFamily make_apriltag_family(const std::string& name, int border);

}  // namespace perch
