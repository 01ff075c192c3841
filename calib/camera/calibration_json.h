#pragma once

#include <filesystem>
#include <string>

#include "calib/camera/calibration.h"
#include "calib/camera/verdict.h"

namespace perch {

// The calibration in numbers, for programs: the chosen lens with its sigmas, every candidate, the verdict,
// every picture.
std::string calibration_json_text(const BoardViews& views, const Calibration& calibration,
                                  const Verdict& verdict);

// Throws CalibrationError when the file cannot be written.
void write_calibration_json(const std::filesystem::path& file, const BoardViews& views,
                            const Calibration& calibration, const Verdict& verdict);

}  // namespace perch
