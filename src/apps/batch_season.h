#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "batch_folder.h"

namespace perch {

// A flight of a run that has come to an end: its result lies in OUT/FLIGHTNAME, or `problem` says why there
// is none.
struct SeasonFlight {
  std::string name;
  std::optional<std::string> problem;
};

// Writes what a run says of all its flights, OUT/summary.csv, report.html and results.sqlite, from their
// folders: whoever estimated them, and when, the bytes are the same. The page shows them beside those of an
// earlier run's folder where `before` names one.
void write_season(const BatchFolder& folder, std::span<const SeasonFlight> flights,
                  const std::string& resolved_configuration, const std::filesystem::path& before);

}  // namespace perch
