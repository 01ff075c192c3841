#pragma once

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "support/run_program.h"

namespace perch {

inline std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::istringstream text(read_file(file));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

// estimates.csv but for the measured times, its last three columns.
inline std::vector<std::string> without_times(std::vector<std::string> lines) {
  for (std::string& line : lines) {
    for (int i = 0; i < 3; ++i) line.resize(line.rfind(','));
  }
  return lines;
}

}  // namespace perch
