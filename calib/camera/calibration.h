#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/lens_covariance.h"
#include "calib/camera/lens_fit.h"
#include "calib/camera/model_difference.h"

namespace perch {

struct CalibrationOptions {
  // Without a name by the user: the three that 13 photographs or more can tell apart. Leaner ones first.
  std::vector<std::string> lens_models{"LENSMODEL_OPENCV4", "LENSMODEL_OPENCV5", "LENSMODEL_OPENCV8"};
  // Focal lengths to start from, px; none: 1, 2.5 and 6 widths of the picture. Too long is harmless.
  std::vector<double> focal_guesses_px;
  bool solve_warp = true;
  // Landing ranges at which uncertainty is told, m.
  std::vector<double> ranges{1, 5, 10};
  uint32_t seed = 1;
};

// Two fits from halves of the pictures, every other one.
struct CrossValidation {
  // Errors with which a half's lens predicts the other half's pictures, of which it has seen none: root mean
  // square per coordinate, px.
  double held_out_px = 0;
  std::vector<double> by_view;  // mean square by view, px^2
  ModelDifference halves;       // between the two lenses
  // Over the places of the picture that corners have covered: the root mean square difference of the halves,
  // and what their own uncertainties predict for it (mean covariance of each).
  double difference_px = 0, predicted_px = 0;
};

// One lens model, with or without regularisation.
struct Candidate {
  LensFit fit;
  LensCovariance covariance;
  std::optional<CrossValidation> cross_validation;  // none of too few pictures
  std::string failure;  // why there is no fit, or not to be trusted; empty: it is fine
  bool usable() const { return failure.empty(); }
  std::string name() const;  // "OPENCV8", "OPENCV8 without regularisation"
};

struct Calibration {
  std::vector<Candidate> candidates;
  size_t chosen = 0;
  std::string why;                   // of the choice, in words
  std::vector<std::string> remarks;  // what went wrong on the way and is of no harm to the choice
  std::vector<LensSeed> seeds;       // best first
  double seed_spread_px =
      0;  // between the best lens solved from its seed and from the others, most in the picture
  std::vector<double> ranges;

  const Candidate& best() const { return candidates[chosen]; }
  const LensFit& fit() const { return best().fit; }
  CameraModel model() const { return fit().model(); }
};

// 0 to 1 and what is being done. May be empty.
using CalibrationProgress = std::function<void(double, const std::string&)>;

// Solves every lens model with and without regularisation, each from halves of the pictures too, and chooses:
// of the regularised ones the leanest whose held-out error is within one standard error of the best (Breiman
// et al., Classification and Regression Trees, 1984, 3.4.3). Never by the error of the fit itself: that is
// the smaller the more a model can bend, and the fewer the pictures. The free solve takes its place where the
// regularisation has moved it by more than a sigma. Throws CalibrationError when none can be solved.
Calibration calibrate_camera(const BoardViews& views, const CalibrationOptions& options,
                             const CalibrationProgress& progress = {});

// A single fit with its covariance, without comparison: 1/30 of the time. For the picture of where to put the
// board next.
Candidate calibrate_once(const BoardViews& views, const std::string& lens, const CalibrationOptions& options);

}  // namespace perch
