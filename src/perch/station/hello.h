#pragma once

#include <string>

#include "perch/station/station.h"

namespace perch {

// What a page is told first: the columns of its rows, the target, the camera's view and the frame chain. Each
// key is in docs/STATION.md.
nlohmann::json hello_json(const StationScene& scene, const StationOptions& options);

}  // namespace perch
