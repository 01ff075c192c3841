// Small targets, rendered by what shares no code with the fit.

#include "perch/detection/picture_fit.h"

#include <gtest/gtest.h>

#include "perch/detection/edge_piece.h"
#include "perch/geometry/euler.h"
#include "perch/simulation/renderer.h"
#include "perch/simulation/sensor.h"
#include "support/drawing.h"
#include "support/rng.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr int kDraws = 60;

const CameraModel& camera() {
  static const CameraModel camera = CameraModel::pinhole(600, 600, 99.5, 79.5, 200, 160);
  return camera;
}

TargetEdges edges_of(const LandingTarget& target) {
  return target_edges(std::get<SquaresLayout>(target.layout), target.size);
}

Eigen::Matrix3d homography_of(const Rigid3& pose) {
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  Eigen::Matrix3d H;
  H << R.col(0), R.col(1), pose.translation;
  return towards_camera(H / H.norm());
}

Rigid3 random_pose(TestRng& rng, double distance) {
  return looking_pose(distance, rng.uniform(0, 50) * kRadFromDeg, rng.uniform(0, 6.3), rng.uniform(0, 6.3),
                      Eigen::Vector2d(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)));
}

PlaneStep random_step(TestRng& rng, double size) {
  PlaneStep step;
  for (double& s : step) s = rng.normal(size);
  step.tail<2>() *= 0.2;
  return step;
}

using Row = std::array<float, PictureRows::kColumns>;

// One pixel, as the first, second, third or fourth of four. False where it is not asked for.
bool row_of(const PictureModel& model, int x, int y, float grey, Row& row) {
  const int lane = std::min(x % PictureRows::kPixels, x - model.first_column());
  PictureRows rows;
  if (lane < 0 || !model.rows_of(x - lane, y, cv::v_setall_f32(grey), rows)) return false;
  std::array<float, PictureRows::kPixels> four;
  for (size_t i = 0; i < row.size(); ++i) {
    cv::v_store(four.data(), rows.d[i]);
    const bool is_set = !rows.flat || i >= PictureRows::kWhite;
    row[i] = is_set ? four[static_cast<size_t>(lane)] : 0;
  }
  return (cv::v_signmask(rows.asked) >> lane & 1) != 0;
}

// Each column of a row against central differences of the level, over a grid of pixels.
TEST(PictureModel, DerivativesAreThoseOfTheLevels) {
  TestRng rng;
  PictureModel model(edges_of(sharp_target()), camera());
  for (int trial = 0; trial < 3; ++trial) {
    const Eigen::Matrix3d H = homography_of(random_pose(rng, 12));
    const ImageFrame frame{H.col(2).hnormalized(), 0.5 / 12};
    PictureParameters p;
    p.blur << 0.7, 0.1, 0.1, 0.55;
    p.growth = 0.05, p.outline_growth = 0.01, p.black = 17;
    p.white = {137, 3, 2}, p.ground = {30, 1, -1};
    const auto level = [&](int i, double h, int x, int y, Row& row) {
      PictureParameters q = p;
      Eigen::Matrix3d G = H;
      if (i < 8) G = towards_camera(corrected(H, frame, h * PlaneStep::Unit(i)));
      if (i == 8) q.blur.diagonal() += Eigen::Vector2d(h, h);
      if (i == 9) q.blur.diagonal() += Eigen::Vector2d(h, -h);
      if (i == 10) q.blur(0, 1) += h, q.blur(1, 0) += h;
      if (i == 11) q.growth += h;
      if (i == 12) q.outline_growth += h;
      if (i >= 13 && i < 16) q.white(i - 13) += h;
      if (i == 16) q.black += h;
      if (i >= 17) q.ground(i - 17) += h;
      EXPECT_TRUE(model.set(G, frame, q));
      return row_of(model, x, y, 0, row);
    };
    for (int i = 0; i < PictureRows::kUnknowns; ++i) {
      double differs = 0, size = 0;
      for (int y = 40; y < 120; y += 3) {
        for (int x = 50; x < 150; x += 3) {
          const double h = i < 8 ? 1e-3 : i < 13 ? 1e-2 : 1;
          Row at, more, less;
          if (!level(i, 0, x, y, at) || !level(i, h, x, y, more) || !level(i, -h, x, y, less)) continue;
          const double numeric = (less[PictureRows::kResidual] - more[PictureRows::kResidual]) / (2 * h);
          differs += std::pow(numeric - at[static_cast<size_t>(i)], 2);
          size += numeric * numeric;
        }
      }
      // The series at the corners is cut; a step of the difference is a hundredth of the blur.
      EXPECT_LT(std::sqrt(differs / size), 0.05) << "column " << i;
    }
  }
}

// Of the levels themselves: blur and pixels are no Gaussian together, corners a series.
TEST(PictureModel, AgreesWithTheRenderer) {
  TestRng rng;
  const LandingTarget target = sharp_target();
  SceneOptions scene;
  scene.ground.contrast = 0;
  scene.ground.stones = 0;
  const OpticsOptions optics{.psf_sigma_px = 0.7, .vignetting = 0};
  const Renderer renderer(camera(), target, scene, optics);
  PictureModel model(edges_of(target), camera());
  for (int trial = 0; trial < 5; ++trial) {
    const Rigid3 pose = random_pose(rng, rng.uniform(9, 20));
    const cv::Mat_<float> light = renderer.radiance(pose);
    PictureParameters p;
    p.blur = (0.49 + 1.0 / 12) * Eigen::Matrix2d::Identity();
    p.white.x() = scene.white, p.black = scene.black, p.ground.x() = scene.ground.reflectance;
    const Eigen::Matrix3d H = homography_of(pose);
    ASSERT_TRUE(model.set(H, {H.col(2).hnormalized(), 0.5 / pose.translation.z()}, p));
    double worst = 0;
    Row row;
    for (int y = model.first_row(); y <= model.last_row(); ++y) {
      for (int x = model.first_column(); x <= model.last_column(); ++x) {
        if (row_of(model, x, y, light(y, x), row))
          worst = std::max(worst, std::abs(double{row[PictureRows::kResidual]}));
      }
    }
    EXPECT_LT(worst, 0.012 * (scene.white - scene.black));
  }
}

// Fits to noisy pictures of a target `aside` of the camera's axis, from a homography that is a pixel off.
double mean_chi_square(const CameraModel& lens, double nearest, double farthest, double aside) {
  TestRng rng;
  const LandingTarget target = sharp_target();
  SceneOptions scene;
  scene.ground.contrast = 0;
  scene.ground.stones = 0;
  const Renderer renderer(lens, target, scene, {.psf_sigma_px = 0.7, .vignetting = 0});
  SensorOptions sensor;
  sensor.full_well = 1e5;
  sensor.read_noise = 2.0 / 255 * 1e5;
  PictureFit fit(edges_of(target), lens);
  double chi_square = 0;
  int found = 0;
  for (int i = 0; i < kDraws; ++i) {
    Rigid3 pose = random_pose(rng, rng.uniform(nearest, farthest));
    pose.translation.x() += aside * pose.translation.z();
    const cv::Mat grey = Sensor(sensor).picture(renderer.radiance(pose), 3, static_cast<uint64_t>(i));
    const Eigen::Matrix3d H = homography_of(pose);
    const ImageFrame frame{H.col(2).hnormalized(), 0.5 / pose.translation.z()};
    const auto fitted = fit.fit(grey, corrected(H, frame, random_step(rng, 0.02)), 1, 0.9, 12);
    if (!fitted) continue;
    ++found;
    const PlaneStep off = step_between(fitted->image_from_plane, H, fitted->frame);
    chi_square += off.dot(fitted->information * off);
    EXPECT_LT(off.head<6>().cwiseAbs().maxCoeff(), 0.01);  // of half the target's size, a tenth of a pixel
  }
  EXPECT_GE(found, kDraws - 1);
  return chi_square / found;
}

// Eight numbers: the mean of chi-squares of eight degrees scatters by 4 / sqrt(n).
TEST(PictureFit, ErrsAsItSays) {
  EXPECT_NEAR(mean_chi_square(camera(), 10, 18, 0), 8, 4 * 4 / std::sqrt(kDraws));
}

// The outline of a target at the picture's edge is bent by a twelfth of a pixel.
TEST(PictureFit, ErrsAsItSaysWhereALensBendsEdges) {
  const CameraModel lens("LENSMODEL_OPENCV4", {453, 453, -90, 79.5, -0.2, 0.02, 0, 0}, 160, 160);
  EXPECT_NEAR(mean_chi_square(lens, 7, 12, 0.38), 8, 4 * 4 / std::sqrt(kDraws));
}

TEST(PictureFit, FindsNothingInNoise) {
  TestRng rng;
  PictureFit fit(edges_of(sharp_target()), camera());
  for (int i = 0; i < 20; ++i) {
    cv::Mat grey(160, 200, CV_8UC1);
    cv::randn(grey, 100, 20);
    EXPECT_FALSE(fit.fit(grey, homography_of(random_pose(rng, 12)), 1, 0.8, 12));
  }
  cv::Mat even(160, 200, CV_8UC1, cv::Scalar(80));
  EXPECT_FALSE(fit.fit(even, homography_of(random_pose(rng, 12)), 1, 0.8, 12));
}

// Half of it is outside.
TEST(PictureFit, LeavesATargetThatIsCutToOthers) {
  PictureFit fit(edges_of(sharp_target()), camera());
  Rigid3 pose = looking_pose(10, 0.2, 0, 0, Eigen::Vector2d(0, 0));
  pose.translation.x() += 1.6;
  EXPECT_FALSE(fit.fit(cv::Mat(160, 200, CV_8UC1, cv::Scalar(80)), homography_of(pose), 1, 0.8, 12));
}

}  // namespace
}  // namespace perch
