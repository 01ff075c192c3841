#include "batch_season.h"

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "perch/analysis/report.h"
#include "perch/analysis/results_database.h"
#include "perch/analysis/season.h"
#include "perch/analysis/summary.h"
#include "perch/config/atomic_file.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// So many flights are in the page itself, which is then all there is to send to somebody; more are links.
constexpr size_t kMostInPage = 20;
constexpr size_t kMostBytesInPage = 20'000'000;

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) throw std::runtime_error(file.string() + ": cannot be read");
  return text.str();
}

Json read_summary(const fs::path& file) {
  Json summary = Json::parse(read(file), nullptr, /*allow_exceptions=*/false);
  if (!summary.is_object()) throw std::runtime_error(file.string() + ": no summary of a flight");
  return summary;
}

// A flight that the earlier run has not is as one that it could not estimate.
Json summary_before(const fs::path& run, const std::string& flight) {
  const fs::path file = run / flight / "summary.json";
  std::error_code ignored;
  return fs::exists(file, ignored) ? read_summary(file) : summary_json(failed_flight(flight, ""));
}

}  // namespace

void write_season(const BatchFolder& folder, std::span<const SeasonFlight> flights,
                  const std::string& resolved_configuration, const fs::path& before) {
  Season season, earlier;
  ResultsDatabase database(folder.path() / "results.sqlite");
  database.add_run("perch-batch " PERCH_VERSION, resolved_configuration);
  std::string csv = summary_csv_header();
  std::vector<std::string> data;
  size_t bytes = 0;
  for (const SeasonFlight& flight : flights) {
    const auto failed = [&] { return failed_flight(flight.name, *flight.problem); };
    const Json summary =
        flight.problem ? summary_json(failed()) : read_summary(folder.of(flight.name) / "summary.json");
    csv += summary_csv_row(summary);
    season.add(summary);
    if (!before.empty()) earlier.add(summary_before(before, flight.name));
    database.add(summary);
    if (flights.size() > kMostInPage || bytes > kMostBytesInPage) continue;
    data.push_back(flight.problem ? flight_data({failed(), {}})
                                  : flight_data_of_page(read(folder.of(flight.name) / "report.html")));
    bytes += data.back().size();
  }
  if (bytes > kMostBytesInPage && flights.size() > 1) data.clear();
  database.commit();
  write_whole_file(folder.path() / "summary.csv", csv);
  write_whole_file(folder.path() / "report.html",
                   season_html(season.json(), before.empty() ? Json(nullptr) : earlier.json(), data,
                               resolved_configuration));
}

}  // namespace perch
