#include "calib/camera/camera_model_file.h"

#include <fstream>

#include "calib/camera/mrcal_problem.h"
#include "calib/camera/numpy_archive.h"
#include "perch/camera/c_numbers.h"

namespace perch {
namespace {

std::string all_digits(double value) {
  const CNumbers dot_is_the_decimal_point;
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

std::string listed(const std::vector<double>& values) {
  std::string text = "[";
  for (const double value : values) text += " " + all_digits(value) + ",";
  return text + "]";
}

// The names and types of mrcal.optimize()'s arguments.
std::string optimization_inputs(const BoardViews& views, const LensFit& fit) {
  const MrcalProblem problem = problem_at(views, fit);
  const size_t count = views.views.size();
  NumpyArchive archive;
  archive.add("lensmodel", {}, std::vector<std::string>{fit.lens});
  archive.add("intrinsics", {1, fit.intrinsics.size()}, fit.intrinsics);
  archive.add("imagersizes", {1, 2}, std::vector<int32_t>{fit.width, fit.height});
  archive.add("extrinsics_rt_fromref", {0, 6}, std::vector<double>{});
  std::vector<double> poses, observations;
  std::vector<int32_t> indices;
  std::vector<std::string> pictures;
  for (size_t i = 0; i < count; ++i) {
    poses.insert(poses.end(), fit.camera_from_board[i].begin(), fit.camera_from_board[i].end());
    indices.insert(indices.end(), {static_cast<int32_t>(i), 0, -1});
    pictures.push_back(views.views[i].picture);
  }
  for (const auto& corner : problem.pool())
    observations.insert(observations.end(), corner.xyz, corner.xyz + 3);
  const auto rows = static_cast<size_t>(views.grid.rows), columns = static_cast<size_t>(views.grid.columns);
  archive.add("frames_rt_toref", {count, 6}, poses);
  archive.add("observations_board", {count, rows, columns, 3}, observations);
  archive.add("indices_frame_camintrinsics_camextrinsics", {count, 3}, indices);
  archive.add("imagepaths", {count}, pictures);
  archive.add("calobject_warp", {2}, std::vector<double>{fit.warp.x(), fit.warp.y()});
  archive.add("calibration_object_spacing", views.grid.spacing);
  const auto selections = selections_of(fit, problem.lens);
  archive.add_bool("do_optimize_intrinsics_core", selections.do_optimize_intrinsics_core);
  archive.add_bool("do_optimize_intrinsics_distortions", selections.do_optimize_intrinsics_distortions);
  archive.add_bool("do_optimize_extrinsics", selections.do_optimize_extrinsics);
  archive.add_bool("do_optimize_frames", selections.do_optimize_frames);
  archive.add_bool("do_optimize_calobject_warp", selections.do_optimize_calobject_warp);
  archive.add_bool("do_apply_regularization", selections.do_apply_regularization);
  archive.add_bool("do_apply_outlier_rejection", selections.do_apply_outlier_rejection);
  archive.add_bool("verbose", false);
  // Python's None.
  for (const char* none : {"points", "observations_point", "indices_point_camintrinsics_camextrinsics"})
    archive.add(none, {}, std::vector<std::string>{""});
  return archive.finish();
}

}  // namespace

std::string camera_model_text(const BoardViews& views, const Candidate& solved) {
  const LensFit& fit = solved.fit;
  std::string text = "# Made by perch-calibrate-camera: " + solved.name() + ", " +
                     std::to_string(fit.corners.size()) + " pictures, corners good to " +
                     all_digits(fit.sigma_px) + " px\n{\n";
  text += "    'lensmodel':  '" + fit.lens + "',\n\n";
  text += "    'intrinsics': " + listed(fit.intrinsics) + ",\n\n";
  // mrcal 2.2 asks for it, newer ones take it.
  text += "    'extrinsics': [ 0, 0, 0, 0, 0, 0, ],\n\n";
  text += "    'imagersize': [ " + std::to_string(fit.width) + ", " + std::to_string(fit.height) + ", ],\n\n";
  if (fit.intrinsics.size() <= 16) {
    std::vector<double> triangle;
    const auto n = static_cast<Eigen::Index>(fit.intrinsics.size());
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index k = i; k < n; ++k) triangle.push_back(solved.covariance.matrix(i, k));
    }
    text += "    'intrinsics_covariance': " + listed(triangle) + ",\n\n";
  }
  text += "    'icam_intrinsics': 0,\n\n";
  text += "    'optimization_inputs': b'" + base85(optimization_inputs(views, fit)) + "',\n}\n";
  return text;
}

void write_camera_model(const std::filesystem::path& file, const BoardViews& views, const Candidate& solved) {
  std::ofstream stream(file, std::ios::binary);
  stream << camera_model_text(views, solved);
  stream.close();
  if (!stream) throw CalibrationError(file.string() + ": cannot be written");
}

}  // namespace perch
