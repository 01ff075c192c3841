#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
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

// The page: one self-contained HTML file that asks the network for nothing. `configuration` is shown as it
// is, the text of Section::resolved(). No name, problem or configuration can break out of its place in the
// page.
std::string report_html(std::span<const ReportFlight> flights, const std::string& configuration);

}  // namespace perch
