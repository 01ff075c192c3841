// A lens from pictures of the landing target, and whether what it says of itself holds.

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <iostream>

#include "calib/camera/board_finder.h"
#include "calib/camera/calibration.h"
#include "perch/simulation/picture.h"
#include "support/drawing.h"
#include "support/rng.h"

namespace perch {
namespace {

// Near and far, tilted all ways, all over the picture.
Rigid3 any_pose(int k, TestRng& rng) {
  const double distance = k % 2 ? 1.8 : 2.5;
  const Eigen::Vector2d aside(0.3 * (k % 3 - 1) + rng.uniform(-0.05, 0.05),
                              0.15 * (k / 3 % 3 - 1) + rng.uniform(-0.03, 0.03));
  return looking_pose(distance, 0.15 + 0.12 * (k % 4) + rng.uniform(-0.05, 0.05), 2.4 * k,
                      rng.uniform(-0.4, 0.4), distance * aside);
}

// Corners of a pad are good to 0.007 px, so that a regularisation made for a pixel would move the lens by
// twice what they say. Two corners of one edge err together, for which 1.5 in a sigma is left.
TEST(PadCalibration, ItsSigmaHoldsOverSeeds) {
  constexpr int kSeeds = 3, kPictures = 30;
  const CameraModel truth("LENSMODEL_OPENCV4", {260, 260.5, 161, 119, -0.22, 0.06, 5e-4, -4e-4}, 320, 240);
  const Board board = read_board(std::filesystem::path(PERCH_SOURCE_DIR) / "configs/targets/sharp.yaml");
  const Renderer renderer(truth, std::get<TargetBoard>(board.pattern).target);
  const auto finder = make_board_finder(board, truth);  // as the last of the program's rounds has it
  CalibrationOptions options;
  options.lens_models = {"LENSMODEL_OPENCV4"};
  TestRng rng;
  double squares = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    BoardViews views{board.grid, 320, 240, {}};
    for (int k = 0; k < kPictures; ++k) {
      const auto light = renderer.radiance(any_pose(k, rng));
      const auto found = finder->find(Sensor().picture(light, rng.bits()));
      if (!found.corners.empty()) views.views.push_back({"view" + std::to_string(k), found.corners});
    }
    EXPECT_GE(views.views.size(), kPictures - 3U);
    const Candidate best = calibrate_camera(views, options).best();
    const Eigen::VectorXd off = Eigen::Map<const Eigen::VectorXd>(best.fit.intrinsics.data(), 8) -
                                Eigen::Map<const Eigen::VectorXd>(truth.intrinsics().data(), 8);
    squares += off.dot(best.covariance.intrinsics().ldlt().solve(off)) / (8 * kSeeds);
  }
  std::cout << "found over predicted: " << std::sqrt(squares) << '\n';
  EXPECT_LT(std::sqrt(squares), 1.7);
  EXPECT_GT(std::sqrt(squares), 0.6);
}

}  // namespace
}  // namespace perch
