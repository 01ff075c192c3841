#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "perch/analysis/score.h"

namespace perch {

// A picture with the recovered target drawn on it, from `overlay_jpeg`.
struct ReportPicture {
  ShownFrame shown;
  std::vector<unsigned char> jpeg;
};

struct ReportFlight {
  FlightScore score;
  std::vector<ReportPicture> pictures;
  nlohmann::json pad = nullptr;  // what the 3-D view draws, from pad_json; or null
};

// A flight's page, which asks the network for nothing but loads its script, most of a page, from the folder
// above: kReportScript, with report_script() in it. `configuration` is shown as it is, the text of
// Section::resolved(). No name, problem or configuration can break out of its place in the page.
std::string flight_html(const ReportFlight& flight, const std::string& configuration);
inline constexpr char kReportScript[] = "report.js";
std::string_view report_script();

// What a page holds of a flight, JSON that is safe within <script>; and the same cut out of a flight's page.
// Empty when it is none.
std::string flight_data(const ReportFlight& flight);
std::string flight_data_of_page(const std::string& html);

// The page of a run, one self-contained file: `season` of all its flights (season.h), and either the data of
// each in its order, or none; then the page links FLIGHTNAME/report.html. `before`: the same flights of an
// earlier run, in the same order; or null.
std::string season_html(const nlohmann::ordered_json& season, const nlohmann::ordered_json& before,
                        std::span<const std::string> flights, const std::string& configuration);

}  // namespace perch
