#pragma once

#include <filesystem>
#include <string>

#include "perch/analysis/report.h"

namespace perch {

// FLIGHTNAME/errors.csv, summary.json and report.html of docs/FORMATS.md, into a folder that exists and is
// not the result yet: a file may be left half written by an error. Without anything to compare with,
// errors.csv is its header alone. What cannot be written is a std::runtime_error that names the file and the
// cause.
void write_flight_files(const std::filesystem::path& folder, const ReportFlight& flight,
                        const std::string& configuration);

}  // namespace perch
