#include "perch/analysis/frame_look.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <opencv2/imgproc.hpp>

#include "perch/geometry/euler.h"

namespace perch {
namespace {

// Straight down on the target from a height, every pixel of one colour.
struct Scene {
  LandingTarget target = read_target(std::filesystem::path(PERCH_SOURCE_DIR) / "configs/targets/sharp.yaml");
  CameraModel camera = CameraModel::pinhole(500, 500, 319.5, 239.5, 640, 480);
  Rigid3 camera_from_target{rotation_from_ypr({0, 0, M_PI}), {0, 0, 2 * target.size}};

  cv::Mat picture() const {
    cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(90));
    for (const Patch& patch : target.patches) {
      std::vector<cv::Point> corners;
      for (const Eigen::Vector2d& p : patch.corners) {
        const auto pixel = camera.pixel_from_camera(camera_from_target * Eigen::Vector3d(p.x(), p.y(), 0));
        corners.emplace_back(cvRound(pixel->x()), cvRound(pixel->y()));
      }
      cv::fillConvexPoly(grey, corners, cv::Scalar(patch.white ? 200 : 30));
    }
    return grey;
  }
};

TEST(TargetViewer, SeesAllOfAnOpenTargetAndItsLevels) {
  const Scene scene;
  const TargetLook look =
      TargetViewer(scene.target).look(scene.picture(), scene.camera, scene.camera_from_target);
  EXPECT_EQ(look.visible, 1);
  EXPECT_EQ(look.white, 200);
  EXPECT_EQ(look.black, 30);
}

TEST(TargetViewer, WhatIsCoveredOrBeyondThePictureIsNotVisible) {
  const Scene scene;
  const TargetViewer viewer(scene.target);
  // A third of the target, which is 250 px wide, under white paper: its black is hidden, its white seems
  // there.
  cv::Mat covered = scene.picture();
  covered(cv::Rect(0, 0, 278, 480)) = 255;
  const TargetLook look = viewer.look(covered, scene.camera, scene.camera_from_target);
  EXPECT_GT(look.visible, 2.0 / 3);
  EXPECT_LT(look.visible, 0.95);
  EXPECT_EQ(look.white, 200);
  EXPECT_EQ(look.black, 30);
  // Half of the target beyond the left edge; a column of places is a twentieth.
  Scene beside = scene;
  beside.camera_from_target.translation.x() = -319.5 / 500 * 2 * scene.target.size;
  EXPECT_NEAR(viewer.look(beside.picture(), beside.camera, beside.camera_from_target).visible, 0.5, 0.05);
  beside.camera_from_target.translation.z() *= -1;  // behind the camera
  EXPECT_EQ(viewer.look(scene.picture(), beside.camera, beside.camera_from_target).visible, 0);
}

TEST(GreyHistogram, HasTheSharesOfAllLevels) {
  cv::Mat grey(80, 80, CV_8UC1, cv::Scalar(7));
  grey(cv::Rect(0, 0, 40, 40)) = 255;
  const auto share = grey_histogram(grey).share;
  EXPECT_NEAR(share.front(), 0.75 * 65535, 0.5);
  EXPECT_NEAR(share.back(), 0.25 * 65535, 0.5);
  EXPECT_EQ(std::accumulate(share.begin() + 1, share.end() - 1, 0), 0);
  EXPECT_THAT(grey_histogram({}).share, testing::Each(0));
}

}  // namespace
}  // namespace perch
