#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "perch/analysis/score.h"

namespace perch {

// The files FORMATS.md names, as text. Numbers that do not exist (no navigation, no frame) are null in JSON
// and empty in CSV; there is never a NaN.

// summary.json of one flight. SI units, times of stages in us; unit and meaning are in the keys.
nlohmann::ordered_json summary_json(const FlightScore& score);

// A flight's number (or word) in summary.csv and in the results' database, and where its summary.json has it.
struct SummaryColumn {
  std::string name;
  std::string unit;  // "[m]", "[]" of a ratio; empty of a count or a word
  nlohmann::ordered_json::json_pointer at;
};
const std::vector<SummaryColumn>& summary_columns();
// Null where there is none; of a list, how many it has.
nlohmann::ordered_json value_of(const nlohmann::ordered_json& summary, const SummaryColumn& column);

// summary.csv: a header that names the units, and a row a flight, of its summary. Each with its line's end.
std::string summary_csv_header();
std::string summary_csv_row(const nlohmann::ordered_json& summary);

// A row for each frame that both vision and navigation know.
std::string errors_csv(const FlightScore& score);

// JSON as text. Bytes that are not UTF-8 (a flight's name may hold any) are replaced.
std::string to_text(const nlohmann::ordered_json& json, int indent = -1);

}  // namespace perch
