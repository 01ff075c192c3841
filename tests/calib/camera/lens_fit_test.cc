#include "calib/camera/lens_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/camera/lens_covariance.h"
#include "calib/camera/mrcal_problem.h"
#include "synthetic_boards.h"

namespace perch {
namespace {

LensFit fit(const BoardViews& views, const std::string& lens, const FitOptions& options = {}) {
  return fit_lens(views, lens, seed_from_focal_length(views, 2 * views.width), options);
}

TEST(LensFit, FindsTheLensAndTheBendWithinThreeSigma) {
  TestRng rng;
  const CameraModel camera = opencv4_camera();
  const SyntheticBoards boards{.views = 30};
  const BoardViews views = synthetic_boards(camera, boards, rng);
  const LensFit found = fit(views, "LENSMODEL_OPENCV4");
  const LensCovariance covariance = lens_covariance(views, found);
  EXPECT_TRUE(found.converged);
  EXPECT_NEAR(found.sigma_px, 0.2, 3 * 0.2 / std::sqrt(2 * 2 * 30 * 48.));
  for (Eigen::Index i = 0; i < 8; ++i) {
    const auto k = static_cast<size_t>(i);
    const double sigma = std::sqrt(covariance.matrix(i, i));
    EXPECT_NEAR(found.intrinsics[k], camera.intrinsics()[k], 3 * sigma) << i;
  }
  EXPECT_NEAR(found.warp.x(), boards.warp.x(), 3 * covariance.warp_sigma.x());
  EXPECT_NEAR(found.warp.y(), boards.warp.y(), 3 * covariance.warp_sigma.y());
}

}  // namespace
}  // namespace perch
