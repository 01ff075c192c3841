#include "perch/analysis/overlay.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "perch/geometry/euler.h"
#include "support/near_pose.h"

namespace perch {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

// A white square of 1 m with a black one in it; features at the inner one's corners.
LandingTarget two_squares() {
  LandingTarget target;
  target.patches = {{square_corners({-0.5, -0.5}, 1), true}, {square_corners({-0.3, -0.3}, 0.6), false}};
  const std::array<const char*, 4> names = {"A0", "A1", "A2", "A3"};
  for (size_t i = 0; i < 4; ++i) target.features.push_back({target.patches[1].corners[i], names[i]});
  return target;
}

// A wide lens: its barrel distortion bends the target's edges by pixels.
CameraModel wide_camera() {
  return CameraModel("LENSMODEL_OPENCV4", {400, 410, 322, 238, -0.25, 0.07, 0.001, -0.002}, 640, 480);
}

Estimate seen_obliquely() {
  Estimate estimate;
  estimate.status = EstimateStatus::kOk;
  // The face's z comes towards the camera: half a turn about x.
  estimate.camera_from_target.mean = {rotation_from_ypr({0.4, 0.3, M_PI - 0.25}), {0.15, -0.1, 1.3}};
  return estimate;
}

TEST(Overlay, OutlineIsWhereOpenCvProjectsTheTarget) {
  const LandingTarget target = two_squares();
  const CameraModel camera = wide_camera();
  const Rigid3 pose = seen_obliquely().camera_from_target.mean;
  const auto outlines = projected_outlines(target, camera, pose);
  ASSERT_THAT(outlines, SizeIs(2));

  const std::vector<double>& i = camera.intrinsics();
  const cv::Matx33d matrix(i[0], 0, i[2], 0, i[1], i[3], 0, 0, 1);
  const cv::Vec4d distortion(i[4], i[5], i[6], i[7]);
  cv::Matx33d rotation;
  cv::eigen2cv(Eigen::Matrix3d(pose.rotation.toRotationMatrix()), rotation);
  cv::Vec3d rotation_vector;
  cv::Rodrigues(rotation, rotation_vector);
  const cv::Vec3d translation(pose.translation.x(), pose.translation.y(), pose.translation.z());
  for (size_t patch = 0; patch < 2; ++patch) {
    // The same walk round the patch, 32 steps an edge and back to the start.
    std::vector<cv::Point3d> points;
    for (size_t k = 0; k <= 4 * 32; ++k) {
      const Quad& corners = target.patches[patch].corners;
      const size_t edge = std::min<size_t>(k / 32, 3);
      const double s = static_cast<double>(k - 32 * edge) / 32;
      const Eigen::Vector2d p = (1 - s) * corners[edge] + s * corners[(edge + 1) % 4];
      points.emplace_back(p.x(), p.y(), 0);
    }
    std::vector<cv::Point2d> pixels;
    cv::projectPoints(points, rotation_vector, translation, matrix, distortion, pixels);
    ASSERT_EQ(outlines[patch].size(), pixels.size());
    for (size_t k = 0; k < pixels.size(); ++k) {
      // Two implementations of one formula, and Rodrigues in between: rounding of hundreds of pixels.
      EXPECT_LE((outlines[patch][k] - Eigen::Vector2d(pixels[k].x, pixels[k].y)).norm(), 1e-9);
    }
  }
}

TEST(Overlay, DrawsTheOutlineOnThePictureAtItsPlace) {
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(128));
  const CameraModel camera = wide_camera();
  const LandingTarget target = two_squares();
  const Estimate estimate = seen_obliquely();
  // As wide as the picture and with all of it round the target: pixels stay where they are.
  const cv::Mat shown = draw_overlay(grey, target, &camera, estimate, {.width_px = 640, .margin = 10});
  ASSERT_EQ(shown.size(), grey.size());
  ASSERT_EQ(shown.type(), CV_8UC3);
  cv::Mat untouched, distance;
  cv::inRange(shown, cv::Scalar(128, 128, 128), cv::Scalar(128, 128, 128), untouched);
  cv::Mat outline_mask(480, 640, CV_8UC1, cv::Scalar(255));
  for (const auto& line : projected_outlines(target, camera, estimate.camera_from_target.mean)) {
    for (const Eigen::Vector2d& p : line) {
      const cv::Point pixel(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
      if (!cv::Rect({0, 0}, grey.size()).contains(pixel)) continue;
      EXPECT_NE(shown.at<cv::Vec3b>(pixel), cv::Vec3b(128, 128, 128));
      outline_mask.at<uchar>(pixel) = 0;
    }
  }
  // And nowhere else: nothing is painted further from the sampled outline than half a step and half the line.
  cv::distanceTransform(outline_mask, distance, cv::DIST_L2, 5);
  double farthest = 0;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      if (untouched.at<uchar>(y, x) == 0) farthest = std::max<double>(farthest, distance.at<float>(y, x));
    }
  }
  EXPECT_LE(farthest, 12);
}

TEST(Overlay, CropsAboutTheTargetAndIsNeverWiderThanThePicture) {
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(128));
  const CameraModel camera = wide_camera();
  Estimate estimate = seen_obliquely();
  EXPECT_EQ(draw_overlay(grey, two_squares(), &camera, estimate).cols, 480);
  EXPECT_EQ(draw_overlay(grey, two_squares(), &camera, estimate, {.width_px = 5000}).cols, 640);
  estimate.camera_from_target.mean.translation.z() = 30;  // 13 px wide
  EXPECT_EQ(draw_overlay(grey, two_squares(), &camera, estimate).cols, 480);
}

TEST(Overlay, WithoutAPoseOrACameraIsThePicture) {
  const cv::Mat grey(48, 64, CV_8UC1, cv::Scalar(77));
  const CameraModel camera = CameraModel::pinhole(60, 60, 32, 24, 64, 48);
  Estimate estimate;
  const cv::Mat lost = draw_overlay(grey, two_squares(), &camera, estimate);
  EXPECT_EQ(lost.size(), grey.size());
  EXPECT_EQ(cv::countNonZero(lost.reshape(1) != 77), 0);
  EXPECT_EQ(cv::countNonZero(draw_overlay(grey, two_squares(), nullptr, seen_obliquely()).reshape(1) != 77),
            0);
}

TEST(Overlay, ATargetBehindOrRoundTheCameraBreaksNothing) {
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(128));
  const CameraModel camera = wide_camera();
  Estimate estimate = seen_obliquely();
  estimate.camera_from_target.mean.translation.z() = -2;
  EXPECT_THAT(projected_outlines(two_squares(), camera, estimate.camera_from_target.mean), IsEmpty());
  EXPECT_FALSE(draw_overlay(grey, two_squares(), &camera, estimate).empty());
  for (const double z : {0.0, 0.05, 0.2, 1e6}) {
    estimate.camera_from_target.mean.translation.z() = z;
    EXPECT_FALSE(draw_overlay(grey, two_squares(), &camera, estimate).empty()) << z;
  }
  estimate.camera_from_target.mean.translation = {100, 0, 1.3};  // beside the picture
  EXPECT_FALSE(draw_overlay(grey, two_squares(), &camera, estimate).empty());
}

TEST(Overlay, AFeatureTheTargetHasNotIsDrawnWithoutAName) {
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(128));
  const CameraModel camera = wide_camera();
  Estimate estimate = seen_obliquely();
  estimate.correspondences = {{-1, {100, 100}, 1}, {4, {200, 100}, 1}, {0, {300, 300}, 1}};
  EXPECT_FALSE(draw_overlay(grey, two_squares(), &camera, estimate).empty());
}

TEST(Overlay, JpegIsThePictureAgain) {
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(128));
  const CameraModel camera = wide_camera();
  const auto bytes = overlay_jpeg(grey, two_squares(), &camera, seen_obliquely());
  EXPECT_EQ(cv::imdecode(bytes, cv::IMREAD_COLOR).size(),
            draw_overlay(grey, two_squares(), &camera, seen_obliquely()).size());
}

}  // namespace
}  // namespace perch
