#include "perch/analysis/output_files.h"

#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "perch/analysis/summary.h"

namespace perch {
namespace {

// Not to the disk at once, as an AtomicFile is: that takes longer than a short flight.
void write(const std::filesystem::path& file, std::string_view text) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) {
    throw std::runtime_error(file.string() + ": cannot be written: " +
                             (errno ? std::generic_category().message(errno) : "an earlier error"));
  }
}

}  // namespace

void write_flight_files(const std::filesystem::path& folder, const ReportFlight& flight,
                        const std::string& configuration) {
  write(folder / "errors.csv", errors_csv(flight.score));
  write(folder / "summary.json", to_text(summary_json(flight.score), 2) + "\n");
  write(folder / "report.html", flight_html(flight, configuration));
}

}  // namespace perch
