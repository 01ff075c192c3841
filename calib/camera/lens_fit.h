#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "calib/camera/board_view.h"
#include "perch/camera/camera_model.h"

namespace perch {

// No calibration can come of these pictures: what() says why and what to do.
class CalibrationError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A corner of a view after the solve, in the view's order.
struct CornerFit {
  Eigen::Vector2d error_px = Eigen::Vector2d::Zero();  // projected minus seen
  bool outlier = false;
};

// A lens model fitted to all views: libmrcal's optimum of lens, board poses and the board's bend at once.
struct LensFit {
  std::string lens;                // mrcal's name
  std::vector<double> intrinsics;  // fx fy cx cy and the lens model's own
  int width = 0, height = 0;
  bool regularised = true;
  bool warp_solved = true;

  // camera_from_board of every view as mrcal has it: rotation vector, translation.
  using PoseVector = Eigen::Matrix<double, 6, 1>;
  std::vector<PoseVector> camera_from_board;
  // How far the board's middle is off the plane through its edges, along its columns and rows, m.
  Eigen::Vector2d warp = Eigen::Vector2d::Zero();
  std::vector<std::vector<CornerFit>> corners;

  int seen = 0;      // corners
  int outliers = 0;  // of these
  int states = 0;    // unknowns of the solve
  // Root mean square of the errors of inliers, per coordinate and whitened: a corner of the usual sigma
  // counts as it is. mrcal's own number divides by missing corners and regularisation too.
  double rms_px = 0;
  // The corners' noise: rms_px with the degrees of freedom that the unknowns took given back.
  double sigma_px = 0;
  double cost = 0;         // what mrcal minimises, px^2
  bool converged = false;  // solved again, the cost stays

  CameraModel model() const { return CameraModel(lens, intrinsics, width, height); }
};

struct FitOptions {
  bool regularise = true;
  bool solve_warp = true;
  bool reject_outliers = true;
  uint32_t seed = 1;  // of the distortions' first values, +-1e-6
};

// Throws CalibrationError for a lens that mrcal does not know, or cannot fit.
void check_lens(const std::string& lens);

// Throws CalibrationError: no or too few views, views of which nothing can be solved (fewer than 6 corners,
// all on a line), corners outside of the grid, twice or not finite, a lens that mrcal does not know.
void check_views(const BoardViews& views, const std::string& lens);

// What all lens models start from: an undistorted stereographic camera and the poses in it.
struct LensSeed {
  double guess_px = 0;             // the focal length it grew from
  std::vector<double> intrinsics;  // fx fy cx cy
  std::vector<LensFit::PoseVector> camera_from_board;
  double cost = 0;  // px^2
};

// A guess that is much too short (a third) ends in a wrong minimum without a word; too long a one does not.
LensSeed seed_from_focal_length(const BoardViews& views, double guess_px);

// mrcal's stages: from the seed the lens and outliers, then from fresh weights the board's bend as well.
LensFit fit_lens(const BoardViews& views, const std::string& lens, const LensSeed& seed,
                 const FitOptions& options);

// The same problem from where another solve of the same lens ended, from fresh weights.
LensFit refit_lens(const BoardViews& views, const LensFit& start, const FitOptions& options);

// The poses alone of views that the lens has not been fitted to: how well it predicts them.
LensFit fit_poses(const BoardViews& views, const LensFit& lens);

}  // namespace perch
