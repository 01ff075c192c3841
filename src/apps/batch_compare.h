#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace perch {

// What changed between two runs, from their summary.json files, as lines for a terminal: rate, errors, honesty
// and times of each flight that both have. `folders` are those of this run, `output`/FLIGHTNAME.
std::string compare_runs(const std::filesystem::path& output, const std::filesystem::path& other,
                         std::span<const std::filesystem::path> folders);

}  // namespace perch
