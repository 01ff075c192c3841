#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace perch {

struct RunComparison {
  std::string text;    // for a terminal
  bool worse = false;  // something is, beyond chance and tolerance
};

// What changed from run A to run B, of the flights that both have: a verdict a line, with intervals, over
// all; and the numbers of each flight where they are few.
RunComparison compare_runs(const std::filesystem::path& a, const std::filesystem::path& b,
                           std::span<const std::string> flights);

// The names of the flights that a run's folder has results of.
std::vector<std::string> flights_of_run(const std::filesystem::path& run);

}  // namespace perch
