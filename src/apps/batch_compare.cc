#include "batch_compare.h"

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

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

// "rate 97.8 % (other 95.6 %)"; a dash for what a run does not know.
std::string pair_of(const json& ours, const json& theirs, const char* pointer, double scale,
                    const char* unit) {
  const auto text = [&](const json& summary) -> std::string {
    const json::json_pointer at(pointer);
    if (!summary.contains(at) || !summary[at].is_number()) return "-";
    char number[32];
    std::snprintf(number, sizeof(number), "%.3f %s", scale * summary[at].get<double>(), unit);
    return number;
  };
  return text(ours) + " (was " + text(theirs) + ")";
}

}  // namespace

std::string compare_runs(const fs::path& output, const fs::path& other, std::span<const fs::path> folders) {
  std::string lines = "against " + other.string() + ":\n";
  for (const auto& folder : folders) {
    const fs::path name = folder.lexically_relative(output);
    const auto ours = read_summary(folder), theirs = read_summary(other / name);
    lines += "  " + name.string() + ": ";
    if (!ours || !theirs) {
      lines += std::string("not in ") + (ours ? "that run" : "this run") + "\n";
      continue;
    }
    lines += "found " + pair_of(*ours, *theirs, "/detection/rate", 100, "%") + ", position RMS " +
             pair_of(*ours, *theirs, "/errors/position_m/rms", 100, "cm") + "\n";
  }
  return lines;
}

}  // namespace perch
