#include "perch/analysis/output_files.h"

#include "perch/analysis/summary.h"
#include "perch/config/atomic_file.h"

namespace perch {
void write_flight_files(const std::filesystem::path& flight_folder, const FlightScore& score) {
  write_whole_file(flight_folder / "errors.csv", errors_csv(score));
  write_whole_file(flight_folder / "summary.json", to_text(summary_json(score), 2) + "\n");
}

void write_run_files(const std::filesystem::path& folder, std::span<const ReportFlight> flights,
                     const std::string& configuration) {
  std::string summary = summary_csv_header();
  for (const ReportFlight& flight : flights) summary += summary_csv_row(flight.score);
  write_whole_file(folder / "summary.csv", summary);
  write_whole_file(folder / "report.html", report_html(flights, configuration));
}

}  // namespace perch
