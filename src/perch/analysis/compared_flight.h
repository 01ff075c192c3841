#pragma once

#include <filesystem>
#include <vector>

#include "perch/analysis/comparison.h"

namespace perch {

// What two runs wrote of one flight, their OUT/FLIGHTNAME, a second after the other. Frames that only one has
// are left out. Throws std::runtime_error naming a file that cannot be read.
std::vector<ComparedFrames> compare_flight(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace perch
