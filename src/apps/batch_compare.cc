#include "batch_compare.h"

#include <array>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

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

}  // namespace

std::string compare_runs(const fs::path& output, const fs::path& other, std::span<const fs::path> folders) {
  std::string lines = "against " + other.string() + ":\n";
  for (const auto& folder : folders) {
    const fs::path name = folder.lexically_relative(output);
    const auto ours = read_summary(folder), theirs = read_summary(other / name);
    if (!ours || !theirs) {
      lines += "  " + name.string() + ": not in " + (ours ? "that run" : "this run") + "\n";
      continue;
    }
    lines += "  " + name.string() + ":\n" + row("", "now", "was", "");
    for (const Quantity& quantity : kQuantities) lines += line_of(quantity, *ours, *theirs);
  }
  return lines;
}

}  // namespace perch
