#pragma once

#include <string_view>

namespace perch {

// What every report carries in it, bundled by web/build.js and compiled in by embed.cmake.
extern const std::string_view kReportJs;  // web/src/report with all that it imports
extern const std::string_view kMountJs;   // the same of a mount calibration
extern const std::string_view kReportCss;

}  // namespace perch
