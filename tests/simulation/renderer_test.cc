#include "perch/simulation/renderer.h"

#include <gmock/gmock.h>

#include <cmath>
#include <opencv2/calib3d.hpp>

#include "simulation/sharp_target.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

constexpr int kWidth = 640, kHeight = 480;

// The scene in which only the target differs from the ground.
SceneOptions plain_scene() {
  SceneOptions scene;
  scene.ground.reflectance = kPlainGround;
  scene.ground.contrast = 0;
  scene.ground.stones = 0;
  return scene;
}

struct Lens {
  const char* name;
  std::vector<double> intrinsics;  // fx fy cx cy, then OpenCV's distortions in its order
};

const std::vector<Lens>& lenses() {
  static const std::vector<Lens> all{
      {"LENSMODEL_PINHOLE", {600, 600, 319.5, 239.5}},
      {"LENSMODEL_OPENCV4", {452.9, 453.6, 314.2, 244.8, -0.131, 0.0187, -0.0005, 0.0003}},
      // 30 % of barrel distortion in the corners.
      {"LENSMODEL_OPENCV5", {420, 418, 325, 236, -0.30, 0.11, 0.0012, -0.0009, -0.018}},
      {"LENSMODEL_OPENCV8", {400, 401, 318, 242, 0.42, 0.06, -0.0006, 0.0008, 0.004, 0.76, 0.17, 0.016}},
  };
  return all;
}

// Looks at a point of the target from a range, tilted about an axis in the face, turned about the camera's
// axis.
Rigid3 looking_at(const Eigen::Vector2d& point, double range, double tilt, double axis, double turn) {
  const Eigen::Quaterniond facing(0, 1, 0, 0);  // half a turn about x: the camera's z against the target's
  const Eigen::Quaterniond tilted(
      Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(axis), std::sin(axis), 0)));
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
  const Rigid3 pose{turned * facing * tilted, Eigen::Vector3d::Zero()};
  const Eigen::Vector3d aim = pose * Eigen::Vector3d(point.x(), point.y(), 0);
  return {pose.rotation, Eigen::Vector3d(0, 0, range) - aim};
}

// OpenCV's own projection of a point of the face.
Eigen::Vector2d by_opencv(const Lens& lens, const Rigid3& camera_from_target, const Eigen::Vector2d& point) {
  const Eigen::Vector3d p = camera_from_target * Eigen::Vector3d(point.x(), point.y(), 0);
  const auto& k = lens.intrinsics;
  const cv::Matx33d K(k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1);
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0),
                    K, std::vector<double>(k.begin() + 4, k.end()), pixels);
  return {pixels[0].x, pixels[0].y};
}

// Measures where an edge crosses the row (or column) of pixels through `pixel`, by how much of the pixels
// across it is on either side, and returns how far from there OpenCV says it is, px. Half a window of `reach`
// pixels must see this edge alone.
double edge_error_px(const cv::Mat_<float>& picture, const Eigen::Vector2d& pixel,
                     const Eigen::Vector2d& tangent, int reach) {
  const bool along_row = std::abs(tangent.y()) > std::abs(tangent.x());
  const int along = along_row ? 0 : 1, across = 1 - along;
  const int line = static_cast<int>(std::lround(pixel[across]));
  const double expected = pixel[along] + (line - pixel[across]) * tangent[along] / tangent[across];
  const int middle = static_cast<int>(std::lround(expected));
  const auto value = [&](int i) {
    return static_cast<double>(along_row ? picture(line, middle + i) : picture(middle + i, line));
  };
  const double before = value(-reach), after = value(reach);
  double share = 0;  // of the pixels between, in pixels, that look like the one before
  for (int i = -reach; i <= reach; ++i) share += (value(i) - after) / (before - after);
  return middle - reach - 0.5 + share - expected;
}

// The worst distance between rendered and projected edges of all squares, px.
double worst_edge_px(const Lens& lens, const Renderer& renderer, double psf, const Rigid3& camera_from_target,
                     int* measured) {
  const int reach = psf > 0 ? static_cast<int>(std::ceil(4 * psf)) + 2 : 3;
  const auto picture = renderer.radiance(camera_from_target);
  double worst = 0;
  for (const Patch& patch : sharp_target().patches) {
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d a = patch.corners[k], b = patch.corners[(k + 1) % 4];
      const Eigen::Vector2d from = by_opencv(lens, camera_from_target, a),
                            to = by_opencv(lens, camera_from_target, b);
      // Away from the corners by more than the window is long.
      const double away = (reach + 2) * 1.5 / (to - from).norm();
      for (double s = away; s < 1 - away; s += 0.013) {
        const Eigen::Vector2d pixel = by_opencv(lens, camera_from_target, a + s * (b - a));
        const Eigen::Vector2d next = by_opencv(lens, camera_from_target, a + (s + 1e-4) * (b - a));
        const double border = reach + 2;
        if (!(pixel.x() > border && pixel.x() < kWidth - border - 1 && pixel.y() > border &&
              pixel.y() < kHeight - border - 1)) {
          continue;
        }
        worst = std::max(worst, std::abs(edge_error_px(picture, pixel, next - pixel, reach)));
        ++*measured;
      }
    }
  }
  return worst;
}

TEST(Renderer, PutsEveryEdgeWhereOpenCvProjectsIt) {
  const std::vector<Rigid3> poses{
      looking_at({0, 0}, 2.5, 0, 0, 0.1),          // head-on
      looking_at({0.1, 0.1}, 2.0, 0.5, 0.7, 1.9),  // tilted 29 degrees
      looking_at({-0.6, 0.5}, 2.2, 0.8, 2.5, 4),   // tilted 46 degrees, in a corner of the picture
      looking_at({0.05, 0.1}, 0.6, 0.3, 4, 0.8),   // larger than the picture
      looking_at({0.9, 0.3}, 4.5, 0.35, 5.5, 2.6)};
  for (const Lens& lens : lenses()) {
    const Renderer renderer({lens.name, lens.intrinsics, kWidth, kHeight}, sharp_target(), plain_scene(),
                            {0, 0});
    for (size_t i = 0; i < poses.size(); ++i) {
      int measured = 0;
      const double worst = worst_edge_px(lens, renderer, 0, poses[i], &measured);
      // The promise is 0.02 px. What is left is mostly the measurement's: half a pixel along the edge's
      // tangent, off by 1/8 px of the edge's curvature in the picture, at most 1 / 50 px where a strong lens
      // is close.
      EXPECT_LT(worst, 0.004) << lens.name << ", pose " << i << ", of " << measured;
      EXPECT_GT(measured, 100) << lens.name << ", pose " << i;
      RecordProperty(std::string(lens.name) + std::to_string(i), std::to_string(worst));
    }
  }
}

TEST(Renderer, BlurLeavesEdgesWhereTheyAre) {
  for (const Lens& lens : lenses()) {
    constexpr double kSigma = 0.7;
    const Renderer renderer({lens.name, lens.intrinsics, kWidth, kHeight}, sharp_target(), plain_scene(),
                            {kSigma, 0});
    int measured = 0;
    const Rigid3 pose = looking_at({0.1, 0.1}, 1.2, 0.5, 0.7, 1.9);
    EXPECT_LT(worst_edge_px(lens, renderer, kSigma, pose, &measured), 0.004) << lens.name;
    EXPECT_GT(measured, 100) << lens.name;
  }
}

TEST(Renderer, ShowsTheWholeAreaOfTheTarget) {
  // Head-on the picture is the face to scale: white minus ground, black minus ground, each times its area.
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  const SceneOptions scene = plain_scene();
  const double white = 1 - 0.7 * 0.7 + 0.25 * 0.25 + 5 * 0.1 * 0.1, black = 1 - white;  // m^2
  for (const double psf : {0.0, 0.8}) {
    const Renderer renderer(camera, sharp_target(), scene, {psf, 0});
    for (const double range : {2.0, 5.0, 40.0}) {  // at 40 m the target is 15 px large and A not four
      const auto picture = renderer.radiance(looking_at({0.03, 0.02}, range, 0, 0, 0.4));
      double sum = 0;
      for (const float value : picture) sum += static_cast<double>(value) - kPlainGround;
      const double scale = 600 * 600 / (range * range);  // px per m^2
      const double expected =
          scale * (white * (scene.white - kPlainGround) + black * (scene.black - kPlainGround));
      // Floats of 0.2 are rounded to 1e-8, 300000 of them, here all alike.
      EXPECT_NEAR(sum, expected, 5e-3) << "range " << range << ", blur " << psf;
    }
  }
}

TEST(Renderer, SpreadsAnEdgeAsAGaussianAndAPixelDo) {
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  constexpr double kSigma = 0.6;
  const SceneOptions scene = plain_scene();
  const Renderer renderer(camera, sharp_target(), scene, {kSigma, 0});
  const auto ramp = [](double x) {  // of the pixel's integral over the Gaussian's
    const double z = x / kSigma;
    return x * 0.5 * std::erfc(-z * M_SQRT1_2) + kSigma * std::exp(-z * z / 2) / std::sqrt(2 * M_PI);
  };
  for (const double phase : {0.0, 0.13, 0.25, 0.4, 0.5, 0.77}) {
    // One m is 300 px: the border's right edge is at column 319.5 + 150 + phase, seen across the middle row.
    const Rigid3 pose{Eigen::Quaterniond(0, 1, 0, 0), {phase / 300, 0, 2}};
    const auto picture = renderer.radiance(pose);
    const double edge = 319.5 + 150 + phase;
    for (int u = 464; u < 476; ++u) {
      const double white = 1 - (ramp(u + 0.5 - edge) - ramp(u - 0.5 - edge));
      const double expected = kPlainGround + white * (scene.white - kPlainGround);
      // Within a cell of h = 1/4 px the profile f is a chord of the true one: off by h^2 / 8 max |f''|, where
      // f'' = g(x + 1/2) - g(x - 1/2) is at most 0.54 for this sigma; and the 6e-5 beyond four sigma.
      EXPECT_NEAR(picture(240, u), expected, 0.0044 * (scene.white - kPlainGround))
          << "phase " << phase << " u " << u;
    }
  }
}

TEST(Renderer, ShowsThePaintsAndTheFallOfLight) {
  const CameraModel camera = CameraModel::pinhole(450, 450, 319.5, 239.5, kWidth, kHeight);
  SceneOptions scene = plain_scene();
  scene.illumination = 0.5;
  const Renderer renderer(camera, sharp_target(), scene, {0.6, 1});
  const Rigid3 pose{Eigen::Quaterniond(0, 1, 0, 0), {0, 0, 2}};
  const auto picture = renderer.radiance(pose);
  const auto expected = [&](const Eigen::Vector2d& point, double reflectance) {
    const Eigen::Vector2d pixel(319.5 + 225 * point.x(), 239.5 - 225 * point.y());
    const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
    const double tan2 = (Eigen::Vector2d(u, v) - Eigen::Vector2d(319.5, 239.5)).squaredNorm() / (450 * 450);
    EXPECT_NEAR(picture(v, u), 0.5 * reflectance / std::pow(1 + tan2, 2), 1e-5);
  };
  expected({0.125, 0.125}, scene.white);  // in A
  expected({0.42, 0.1}, scene.white);     // on the border
  expected({0.0, 0.3}, scene.black);
  expected({-1.3, 0.9}, kPlainGround);  // far out, where cos^4 is 0.62
}

TEST(Renderer, GroundMovesWithTheWorld) {
  // Twice as near and shifted: the same place has the same brightness, whatever pixel it is on.
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  const Renderer renderer(camera, LandingTarget{}, {}, {0, 0});
  const Rigid3 one{Eigen::Quaterniond(0, 1, 0, 0), {0, 0, 2}},
      other{Eigen::Quaterniond(0, 1, 0, 0), {0.1, -0.05, 2}};
  const auto a = renderer.radiance(one), b = renderer.radiance(other);
  // 0.1 m are 30 px, 0.05 m 15 px upwards in the picture.
  for (int v = 20; v < 460; v += 7) {
    for (int u = 20; u < 600; u += 11) EXPECT_NEAR(a(v, u), b(v - 15, u + 30), 1e-5);
  }
  cv::Scalar mean, deviation;
  cv::meanStdDev(a, mean, deviation);
  EXPECT_GT(deviation[0], 0.02);  // there is something to see
}

TEST(Renderer, ShadowIsDarkerByItsFactorAndMoves) {
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  SceneOptions scene = plain_scene();
  scene.shadow = ShadowEdge{0, 0.1, 0.5, 0.25, 0.04};
  const Renderer renderer(camera, sharp_target(), scene, {0, 0});
  const Rigid3 pose{Eigen::Quaterniond(0, 1, 0, 0), {0, 0, 2}};
  const auto column = [](double x) { return static_cast<int>(std::lround(319.5 + 300 * x)); };
  const int row = 30;  // on bare ground
  const auto before = renderer.radiance(pose, 0), after = renderer.radiance(pose, 1);
  EXPECT_NEAR(before(row, column(0.0)), 0.25 * kPlainGround, 1e-6);
  EXPECT_NEAR(before(row, column(0.2)), kPlainGround, 1e-6);
  EXPECT_NEAR(after(row, column(0.5)), 0.25 * kPlainGround, 1e-6);
  EXPECT_NEAR(after(row, column(0.7)), kPlainGround, 1e-6);
  // Half the light in the middle of the penumbra; a pixel is a twelfth of it wide, half a pixel off gives 6
  // %.
  EXPECT_NEAR(before(row, column(0.1)), 0.625 * kPlainGround, 0.06 * kPlainGround);
}

TEST(Renderer, MotionBlurCentresEdgesOnMidExposure) {
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  const Renderer renderer(camera, sharp_target(), plain_scene(), {0, 0});
  const double speed = 2;  // m/s along x: at 2 m range 6 px in 10 ms
  const PoseAt moving = [&](double t) {
    return Rigid3{Eigen::Quaterniond(0, 1, 0, 0), {0.001 + speed * t, 0, 2}};
  };
  const auto sharp = renderer.radiance(moving, {0.01, 0, false});
  const auto blurred = renderer.radiance(moving, {0.01, 0, true});
  const Eigen::Vector2d pixel(319.5 + 300 * 0.501, 240);
  EXPECT_NEAR(edge_error_px(sharp, pixel, {0, 1}, 6), 0, 1e-4);
  EXPECT_NEAR(edge_error_px(blurred, pixel, {0, 1}, 6), 0, 1e-4);
  // Across six pixels the light falls evenly.
  EXPECT_NEAR(blurred(240, 470) - blurred(240, 471), (0.8 - kPlainGround) / 6, 1e-3);
}

TEST(Renderer, RollingShutterSlantsWhatMoves) {
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  const Renderer renderer(camera, sharp_target(), plain_scene(), {0, 0});
  const PoseAt moving = [&](double t) { return Rigid3{Eigen::Quaterniond(0, 1, 0, 0), {t, 0, 2}}; };
  const auto picture = renderer.radiance(moving, {0.001, 0.02, false});
  for (const int row : {120, 239, 240, 360}) {
    const double t = 0.02 * (row / 479.0 - 0.5);
    EXPECT_NEAR(edge_error_px(picture, {319.5 + 300 * (0.5 + t), row}, {0, 1}, 3), 0, 1e-4) << row;
  }
}

TEST(Renderer, SeesSkyBeyondTheHorizonAndNothingOfTheBackOfAPad) {
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  const Renderer renderer(camera, sharp_target(), plain_scene());
  // Level above the ground: the horizon is in the middle row.
  const auto level = renderer.radiance(looking_at({0, 0}, 5, M_PI / 2 - 0.05, 0, 0));
  double low = 1, high = 0;
  for (const float value : level) {
    ASSERT_TRUE(std::isfinite(value));
    low = std::min<double>(low, value);
    high = std::max<double>(high, value);
  }
  EXPECT_LT(low, 0.25);
  EXPECT_GT(high, 0.4);
  const auto below = renderer.radiance(Rigid3{Eigen::Quaterniond::Identity(), {0, 0, 2}});
  EXPECT_NEAR(below(240, 320), 0.5, 1e-3);
}

TEST(Renderer, GivesTheSamePictureAgain) {
  const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, kWidth, kHeight);
  const Rigid3 pose = looking_at({0.1, 0.1}, 2.0, 0.5, 0.7, 1.9);
  const Renderer one(camera, sharp_target()), other(camera, sharp_target());
  EXPECT_EQ(cv::norm(one.radiance(pose), other.radiance(pose), cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(one.radiance(pose), one.radiance(pose), cv::NORM_INF), 0);
}

}  // namespace
}  // namespace perch
