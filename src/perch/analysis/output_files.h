#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "perch/analysis/report.h"

namespace perch {

// The files of docs/FORMATS.md that hold results, each whole or not there. What cannot be written is a
// std::runtime_error that names the file and the cause.

// FLIGHTNAME/errors.csv and summary.json, into a folder that exists. Without anything to compare with,
// errors.csv is its header alone.
void write_flight_files(const std::filesystem::path& flight_folder, const FlightScore& score);

// summary.csv and report.html, for all flights of a run.
void write_run_files(const std::filesystem::path& folder, std::span<const ReportFlight> flights,
                     const std::string& configuration);

}  // namespace perch
