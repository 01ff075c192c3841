#pragma once

#include <filesystem>
#include <string>

#include "calib/camera/calibration.h"
#include "calib/camera/verdict.h"

namespace perch {

// One self-contained page without scripts that asks the network for nothing: the verdict in words, and
// pictures of what it rests on. `model_file` is named in the commands of mrcal's own plots.
std::string calibration_report_html(const BoardViews& views, const Calibration& calibration,
                                    const Verdict& verdict, const std::string& model_file);

// Throws CalibrationError when the file cannot be written.
void write_calibration_report(const std::filesystem::path& file, const BoardViews& views,
                              const Calibration& calibration, const Verdict& verdict,
                              const std::string& model_file);

}  // namespace perch
