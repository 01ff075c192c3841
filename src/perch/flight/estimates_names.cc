#include "perch/flight/estimates_names.h"

namespace perch {

const std::vector<std::string>& estimate_columns() {
  static const std::vector<std::string> columns = [] {
    std::vector<std::string> names{
        "timestamp [ns]", "status", "x [m]", "y [m]", "z [m]", "q_w", "q_x", "q_y", "q_z"};
    for (char row = '0'; row < '6'; ++row) {
      for (char column = row; column < '6'; ++column) names.push_back(std::string("cov_") + row + column);
    }
    for (const char* name :
         {"reprojection_rms [px]", "features", "ambiguity", "detect [us]", "pose [us]", "total [us]"}) {
      names.emplace_back(name);
    }
    return names;
  }();
  return columns;
}

const std::vector<std::string>& state_columns() {
  // The units stand where docs/FORMATS.md has them: behind the last of three.
  static const std::vector<std::string> columns{"timestamp [ns]",
                                                "x",
                                                "y",
                                                "z [m]",
                                                "q_w",
                                                "q_x",
                                                "q_y",
                                                "q_z",
                                                "v_x",
                                                "v_y",
                                                "v_z [m/s]",
                                                "w_x",
                                                "w_y",
                                                "w_z [rad/s]",
                                                "sigma_x",
                                                "sigma_y",
                                                "sigma_z",
                                                "sigma_rx",
                                                "sigma_ry",
                                                "sigma_rz",
                                                "sigma_vx",
                                                "sigma_vy",
                                                "sigma_vz",
                                                "sigma_wx",
                                                "sigma_wy",
                                                "sigma_wz",
                                                "source"};
  return columns;
}

}  // namespace perch
