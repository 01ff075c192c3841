#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "perch/analysis/score.h"

namespace perch {

// The files FORMATS.md names, as text. Numbers that do not exist (no navigation, no frame) are null in JSON
// and empty in CSV; there is never a NaN.

// summary.json of one flight. SI units, times of stages in us; unit and meaning are in the keys.
nlohmann::ordered_json summary_json(const FlightScore& score);

// summary.csv: a header that names the units, and a row a flight. Each with its line's end.
std::string summary_csv_header();
std::string summary_csv_row(const FlightScore& score);

// A row for each frame that both vision and navigation know.
std::string errors_csv(const FlightScore& score);

// JSON as text. Bytes that are not UTF-8 (a flight's name may hold any) are replaced.
std::string to_text(const nlohmann::ordered_json& json, int indent = -1);

}  // namespace perch
