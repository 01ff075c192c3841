#pragma once

#include <string_view>

namespace perch {

// Files of web/ that every report carries in it, compiled in by embed.cmake.
extern const std::string_view kUplotJs;  // node_modules/uplot
extern const std::string_view kUplotCss;
extern const std::string_view kPlotsJs;  // web/report
extern const std::string_view kReportJs;
extern const std::string_view kReportCss;

}  // namespace perch
