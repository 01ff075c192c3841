#include "batch_compare.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "perch/analysis/compared_flight.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::optional<json> read_summary(const fs::path& folder) {
  std::ifstream stream(folder / "summary.json");
  json summary = json::parse(stream, nullptr, /*allow_exceptions=*/false);
  if (summary.is_discarded()) return std::nullopt;
  return summary;
}

// A number of summary.json, and how it is shown.
struct Quantity {
  const char* name;
  const char* pointer;
  double shown_per_si;
  const char* unit;
};

constexpr double kCmFromM = 100;
constexpr std::array<Quantity, 15> kQuantities{{
    {"with a pose", "/detection/rate", 100, "%"},
    {"x RMS", "/errors/x/rms", kCmFromM, "cm"},
    {"y RMS", "/errors/y/rms", kCmFromM, "cm"},
    {"z RMS", "/errors/z/rms", kCmFromM, "cm"},
    {"yaw RMS", "/errors/yaw/rms", kDegFromRad, "deg"},
    {"pitch RMS", "/errors/pitch/rms", kDegFromRad, "deg"},
    {"roll RMS", "/errors/roll/rms", kDegFromRad, "deg"},
    {"position RMS", "/errors/position_m/rms", kCmFromM, "cm"},
    {"position over range", "/errors/position_over_range_rms", 100, "%"},
    {"position RMS, truth", "/truth/position_m/rms", kCmFromM, "cm"},
    {"rotation RMS, truth", "/truth/rotation_rad/rms", kDegFromRad, "deg"},
    {"mean NEES", "/consistency/mean_nees", 1, ""},
    {"reprojection RMS", "/reprojection_rms_px/rms", 1, "px"},
    {"median time a frame", "/total_us/median", 1, "us"},
    {"99 % time a frame", "/total_us/p99", 1, "us"},
}};

std::optional<double> value_of(const json& summary, const Quantity& quantity) {
  const json::json_pointer at(quantity.pointer);
  if (!summary.contains(at) || !summary[at].is_number()) return std::nullopt;
  return quantity.shown_per_si * summary[at].get<double>();
}

std::string row(const char* name, const std::string& now, const std::string& was, const char* unit) {
  char line[160];
  std::snprintf(line, sizeof(line), "    %-20s %12s %12s%s%s\n", name, now.c_str(), was.c_str(),
                *unit ? "  " : "", unit);
  return line;
}

// A dash for what a run does not know; no line for what neither does.
std::string line_of(const Quantity& quantity, const json& ours, const json& theirs) {
  const auto now = value_of(ours, quantity), was = value_of(theirs, quantity);
  if (!now && !was) return "";
  const auto text = [](const std::optional<double>& value) -> std::string {
    if (!value) return "-";
    char number[32];
    std::snprintf(number, sizeof(number), "%.3f", *value);
    return number;
  };
  return row(quantity.name, text(now), text(was), quantity.unit);
}

std::string table_of(const std::string& name, const json& ours, const json& theirs) {
  std::string lines = "  " + name + ":\n" + row("", "B", "A", "");
  for (const Quantity& quantity : kQuantities) lines += line_of(quantity, ours, theirs);
  return lines;
}

// Fewer flights than this say little of others; then it is their seconds that are drawn.
constexpr size_t kFewFlights = 10;
constexpr size_t kMostTables = 20;

ComparedFrames sum_of(const std::vector<ComparedFrames>& samples) {
  ComparedFrames sum;
  for (const ComparedFrames& sample : samples) sum += sample;
  return sum;
}

}  // namespace

RunComparison compare_runs(const fs::path& a, const fs::path& b, std::span<const std::string> flights) {
  std::vector<std::vector<ComparedFrames>> compared;
  std::string tables, missing;
  RunComparison comparison;
  for (const std::string& name : flights) {
    const auto ours = read_summary(b / name), theirs = read_summary(a / name);
    if (!ours || !theirs) {
      const bool lost = theirs.has_value();
      missing += "  " + name + ": not in " + (ours ? "A" : theirs ? "B: worse" : "A, nor in B") + "\n";
      comparison.worse = comparison.worse || lost;
      continue;
    }
    compared.push_back(compare_flight(a / name, b / name));
    if (flights.size() <= kMostTables) tables += table_of(name, *ours, *theirs);
  }
  std::vector<ComparedFrames> samples;
  const bool few = compared.size() < kFewFlights;
  for (const auto& flight : compared) {
    if (!few) samples.push_back(sum_of(flight));
    if (few) samples.insert(samples.end(), flight.begin(), flight.end());
  }
  comparison.text = "A: " + a.string() + ", B: " + b.string() + ", " + std::to_string(compared.size()) +
                    " flights, " + std::to_string(sum_of(samples).frames) + " frames; 95 % intervals by " +
                    (few ? "seconds, of these flights alone:\n" : "flights:\n");
  for (const Change& change : changes_of(samples)) {
    const bool worse = change.counts && change.verdict == Verdict::kWorse;
    comparison.text += "  " + change.sentence + (worse ? ": worse\n" : "\n");
    comparison.worse = comparison.worse || worse;
  }
  comparison.text += missing + tables;
  return comparison;
}

std::vector<std::string> flights_of_run(const fs::path& run) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(run)) {
    if (fs::exists(entry.path() / "summary.json")) names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace perch
