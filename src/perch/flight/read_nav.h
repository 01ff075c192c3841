#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "perch/camera/csv.h"
#include "perch/flight/flight.h"

namespace perch {

// Both throw std::runtime_error when the file cannot be read or its header lacks a column; rows that cannot
// be used are skipped and noted with file and line.

// nav0/data.csv or EuRoC's state_groundtruth_estimate0/data.csv, told apart by the header. Quaternions of any
// length but 0 are normalised; where velocities are missing they are taken from the positions.
NavTrack read_nav(const std::filesystem::path& file, std::vector<std::string>& problems,
                  LastLine last_line = LastLine::kMayLackEnd);

std::vector<GimbalSample> read_gimbal(const std::filesystem::path& file, std::vector<std::string>& problems,
                                      LastLine last_line = LastLine::kMayLackEnd);

}  // namespace perch
