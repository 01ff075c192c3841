#pragma once

#include <nlohmann/json.hpp>

#include "perch/geometry/rigid3.h"
#include "perch/target/landing_target.h"

namespace perch {

// A transform as pages take it: x, y, z [m], q_w, q_x, q_y, q_z.
nlohmann::json transform_json(const Rigid3& transform);

// The pad as the pages' 3-D view (web/src/views/scene.js) draws it: `size`, `patches`, `pad_from_target`.
nlohmann::json pad_json(const LandingTarget& target, const Rigid3& pad_from_target);

}  // namespace perch
