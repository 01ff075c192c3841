#pragma once

#include <string>
#include <vector>

#include "perch/camera/camera_model.h"
#include "support/rng.h"

namespace perch {

inline const std::vector<std::string>& closed_form_lenses() {
  static const std::vector<std::string> names{"LENSMODEL_PINHOLE", "LENSMODEL_OPENCV4", "LENSMODEL_OPENCV5",
                                              "LENSMODEL_OPENCV8", "LENSMODEL_OPENCV12"};
  return names;
}

inline const std::vector<std::string>& other_lenses() {
  static const std::vector<std::string> names{
      "LENSMODEL_STEREOGRAPHIC",
      "LENSMODEL_LONLAT",
      "LENSMODEL_LATLON",
      "LENSMODEL_CAHVOR",
      "LENSMODEL_CAHVORE_linearity=0.37",
      "LENSMODEL_SPLINED_STEREOGRAPHIC_order=2_Nx=11_Ny=9_fov_x_deg=120",
      "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=11_Ny=9_fov_x_deg=120"};
  return names;
}

inline size_t intrinsics_of(const std::string& lens) {
  if (lens == "LENSMODEL_OPENCV4") return 8;
  if (lens == "LENSMODEL_OPENCV5" || lens == "LENSMODEL_CAHVOR") return 9;
  if (lens == "LENSMODEL_OPENCV8" || lens.starts_with("LENSMODEL_CAHVORE")) return 12;
  if (lens == "LENSMODEL_OPENCV12") return 16;
  if (lens.starts_with("LENSMODEL_SPLINED")) return 4 + 2 * 11 * 9;
  return 4;
}

// A camera of 1280 x 960 with distortions as large as those of cheap wide lenses: 0.3 in radius, 0.01
// sideways.
inline CameraModel random_camera(TestRng& rng, const std::string& lens) {
  const double focal = rng.uniform(400, 3000);
  std::vector<double> intrinsics{focal, focal * rng.uniform(0.98, 1.02), rng.uniform(600, 680),
                                 rng.uniform(450, 510)};
  const bool opencv = lens.starts_with("LENSMODEL_OPENCV");
  for (size_t i = 4; i < intrinsics_of(lens); ++i) {
    const size_t k = i - 4;
    const bool radial = opencv && k != 2 && k != 3 && k < 8;
    intrinsics.push_back(rng.uniform(-1, 1) * (radial ? 0.3 : 0.01));
  }
  return CameraModel(lens, intrinsics, 1280, 960);
}

// A point seen at a random place in the picture and around it.
inline Eigen::Vector3d random_point(TestRng& rng, const CameraModel& camera) {
  const auto& k = camera.intrinsics();
  const double z = rng.uniform(0.1, 50);
  return {z * (rng.uniform(-200, 1480) - k[2]) / k[0], z * (rng.uniform(-200, 1160) - k[3]) / k[1], z};
}

}  // namespace perch
