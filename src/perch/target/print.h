#pragma once

#include <filesystem>
#include <vector>

#include "perch/target/sheet.h"

namespace perch {

struct PrintOptions {
  Paper paper = Paper::kNone;
  double dpi = 300;   // of PNG; what office printers resolve
  bool bare = false;  // the target alone, without margins, marks and rulers: as a texture. With kNone only
};

// Draws the target to scale into PDF, SVG or PNG files, by the output's extension. A PDF is one file of one
// or more pages, an overview first where there are tiles; SVG and PNG tiles are files of their own:
// pad-overview.svg, pad-r1c1.svg, ... Returns what was written. Each file appears whole or not at all.
// Throws std::runtime_error when a file cannot be written or its picture would be too large, and
// std::invalid_argument on an extension or a combination of options that is none.
std::vector<std::filesystem::path> print_target(const LandingTarget& target,
                                                const std::filesystem::path& output,
                                                const PrintOptions& options);

}  // namespace perch
