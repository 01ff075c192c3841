#pragma once

#include <filesystem>
#include <string>

#include "calib/camera/calibration.h"

namespace perch {

// The text of a *.cameramodel: what mrcal's own Python tools write, with every digit, and so what all of them
// open.
//   'optimization_inputs'    the whole problem at its solution, from which mrcal-show-projection-uncertainty,
//                            -residuals and the like compute: a NumPy .npz in base 85
//   'intrinsics_covariance'  ours, which mrcal passes over: the upper triangle by rows of the covariance of
//   the
//                            intrinsics, for the flight's pose covariance. Of lens models with up to 16
//                            intrinsics; a spline's hundreds would be a hundred thousand numbers.
std::string camera_model_text(const BoardViews& views, const Candidate& solved);

// Throws CalibrationError when the file cannot be written.
void write_camera_model(const std::filesystem::path& file, const BoardViews& views, const Candidate& solved);

}  // namespace perch
