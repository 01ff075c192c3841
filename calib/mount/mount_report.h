#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/mount/cross_validation.h"

namespace perch {

// The page of a calibration: one file that opens offline. `yaml` is shown as it is; `pad` is what the 3-D
// view draws, from pad_json; or null.
std::string mount_report_html(const MountProblem& problem, const MountSolution& solution,
                              const std::vector<HeldOut>& held_out, const std::string& yaml,
                              const nlohmann::json& pad = nullptr);

}  // namespace perch
