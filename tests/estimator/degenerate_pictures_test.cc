// Pictures at the edge of what a picture is. Nothing crashes, nothing is found that is not there, and what is
// found is right.

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include "support/drawing.h"
#include "support/near_pose.h"
#include "support/random_picture.h"
#include "support/whole_frame.h"

namespace perch {
namespace {

CameraModel camera_of(int width, int height, double focal = 600) {
  return CameraModel::pinhole(focal, focal, 0.5 * (width - 1), 0.5 * (height - 1), width, height);
}

cv::Mat even(int width, int height, int grey) { return {height, width, CV_8UC1, cv::Scalar(grey)}; }

class DegeneratePictures : public testing::TestWithParam<std::string> {
 protected:
  const RunConfig config = run_config_of(GetParam());

  // Through an estimator that has seen nothing else, by a camera of the picture's size.
  Estimate estimate(const cv::Mat& grey, const Estimator::Aid& aid = {}) const {
    return Estimator(config, camera_of(grey.cols, grey.rows)).process(lone_frame(0, grey), aid);
  }
  Estimate estimate_of(const CameraModel& camera, const Rigid3& camera_from_target,
                       const Drawing& drawing = {}) const {
    const cv::Mat grey = picture_of(config.target, camera, camera_from_target, drawing);
    return Estimator(config, camera).process(lone_frame(0, grey), level_pad(camera_from_target));
  }

  void expect_nothing(const cv::Mat& grey) const {
    const Estimate e = estimate(grey);
    EXPECT_EQ(e.status, EstimateStatus::kNoTarget) << to_string(e.status);
    EXPECT_FALSE(e.pad_from_body);
    EXPECT_FALSE(e.state);
  }
};

// Either no pose, or this one: what corners of half a pixel do stays below a twentieth of the distance here.
MATCHER_P(IsNoPoseBut, truth, "") {
  *result_listener << to_string(arg.status) << " ";
  if (arg.status == EstimateStatus::kUnreadable) return false;
  if (arg.status != EstimateStatus::kOk) return !arg.pad_from_body.has_value();
  return testing::ExplainMatchResult(IsNearPose(truth, 0.2, 0.05 * truth.translation.norm()),
                                     arg.camera_from_target.mean, result_listener);
}

TEST_P(DegeneratePictures, OneGreyLevelShowsNothing) {
  for (const int grey : {0, 1, 128, 254, 255}) expect_nothing(even(640, 480, grey));
}

TEST_P(DegeneratePictures, OnePixelOneRowOrOneColumnShowNothing) {
  TestRng rng;
  const cv::Size sizes[] = {{1, 1}, {640, 1}, {1, 480}, {2, 2}, {3, 3}, {7, 2}, {640, 2}, {2, 480}, {16, 16}};
  for (const cv::Size& size : sizes) {
    for (const int grey : {0, 255}) expect_nothing(even(size.width, size.height, grey));
    expect_nothing(random_picture(rng, size.width, size.height));
    expect_nothing(random_binary(rng, size.width, size.height, 0.5));
  }
}

TEST_P(DegeneratePictures, NoiseShowsNothing) {
  TestRng rng;
  for (const double density : {0.05, 0.5, 0.95}) expect_nothing(random_binary(rng, 640, 480, density));
  cv::Mat grey = random_picture(rng, 640, 480);
  expect_nothing(grey);
  for (const double blur : {1.0, 3.0, 10.0}) {
    cv::GaussianBlur(grey, grey, {}, blur);
    cv::normalize(grey, grey, 0, 255, cv::NORM_MINMAX);
    expect_nothing(grey);
  }
}

TEST_P(DegeneratePictures, ACheckerboardShowsNothing) {
  for (const int side : {1, 2, 3, 8, 20, 57, 160, 320}) {
    cv::Mat grey = even(640, 480, 20);
    for (int v = 0; v < grey.rows; ++v) {
      for (int u = 0; u < grey.cols; ++u) {
        if ((u / side + v / side) % 2 == 0) grey.at<uint8_t>(v, u) = 220;
      }
    }
    expect_nothing(grey);
  }
}

TEST_P(DegeneratePictures, ATargetOfThreePixelsIsNoTarget) {
  // 600 px of focal length, 1 m: 200 m away. With the pixels' grid anywhere on it.
  TestRng rng;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d off(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5));
    const auto pose = looking_pose(200, rng.uniform(0, 0.5), 1, rng.uniform(0, 6), off);
    EXPECT_EQ(estimate_of(camera_of(64, 48), pose).status, EstimateStatus::kNoTarget);
  }
}

TEST_P(DegeneratePictures, AVeryWidePictureIsLikeAnother) {
  const CameraModel camera = camera_of(8192, 120, 300);
  expect_nothing(even(8192, 120, 60));
  for (const double x : {-30.0, 0.0, 30.0}) {  // at 3.3 m that is 2700 px from the middle
    const auto pose = looking_pose(3.3, 0.1, 1, 0.4, {x, 0});
    EXPECT_THAT(estimate_of(camera, pose), IsNoPoseBut(pose)) << x;
  }
  const auto middle = looking_pose(3.3, 0.1, 1, 0.4);
  EXPECT_EQ(estimate_of(camera, middle).status, EstimateStatus::kOk);
}

TEST_P(DegeneratePictures, ATargetThatFillsThePictureExactlyIsRightOrNone) {
  // Its outer edges are the picture's: 480 px of border to border, 1 m away.
  for (const double pixels : {478.0, 479.0, 480.0, 481.0, 482.0, 500.0}) {
    const double focal = 600, distance = focal / pixels;
    const CameraModel camera = camera_of(480, 480, focal);
    const Rigid3 pose = looking_pose(distance, 0, 0, 0);
    EXPECT_THAT(estimate_of(camera, pose), IsNoPoseBut(pose)) << pixels;
  }
}

TEST_P(DegeneratePictures, ATargetThatLeavesThePictureIsRightOrNone) {
  const CameraModel camera = camera_of(320, 240, 300);
  for (double x = 0; x < 2; x += 0.05) {
    const Rigid3 pose = looking_pose(2, 0.2, 1, 0.4, {x, x / 3});
    const Estimate e = estimate_of(camera, pose);
    EXPECT_THAT(e, IsNoPoseBut(pose)) << x;
    if (x < 0.5) {
      EXPECT_EQ(e.status, EstimateStatus::kOk) << x;
    }
  }
  for (double distance = 1.2; distance > 0.1; distance -= 0.05) {
    const Rigid3 pose = looking_pose(distance, 0.1, 1, 0.4);
    EXPECT_THAT(estimate_of(camera, pose), IsNoPoseBut(pose)) << distance;
  }
}

// The layout is its own mirror image about the diagonal through A and D: a mirrored picture is the picture of
// the same target in another pose, and nothing in it can tell. What can be asked is that pose.
TEST_P(DegeneratePictures, AMirroredTargetIsThePoseThatThePictureShows) {
  const CameraModel camera = camera_of(640, 480);
  const Rigid3 pose = looking_pose(3, 0.3, 1, 0.4, {0.2, -0.1});
  cv::Mat grey = picture_of(config.target, camera, pose), mirrored;
  cv::flip(grey, mirrored, 1);
  // The target's plane mirrored about that diagonal, and the camera's about x = 0, are one rotation.
  Eigen::Matrix3d swap, flip = Eigen::Vector3d(-1, 1, 1).asDiagonal();
  swap << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  const Rigid3 seen{Eigen::Quaterniond(flip * pose.rotation.toRotationMatrix() * swap),
                    flip * pose.translation};
  const Estimate e = estimate(mirrored, level_pad(seen));
  EXPECT_EQ(e.status, EstimateStatus::kOk);
  EXPECT_THAT(e, IsNoPoseBut(seen));
}

TEST_P(DegeneratePictures, ANegativeIsNoTarget) {
  const CameraModel camera = camera_of(640, 480);
  const cv::Mat grey = picture_of(config.target, camera, looking_pose(3, 0.3, 1, 0.4));
  expect_nothing(255 - grey);
}

TEST_P(DegeneratePictures, ATargetOfOneLevelContrastIsRightOrNone) {
  const CameraModel camera = camera_of(640, 480);
  const Rigid3 pose = looking_pose(3, 0.3, 1, 0.4);
  for (const int contrast : {1, 2, 3, 5, 10}) {
    Drawing faint;
    faint.ground = faint.black = 100;
    faint.white = 100 + contrast;
    EXPECT_THAT(estimate_of(camera, pose, faint), IsNoPoseBut(pose)) << contrast;
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, DegeneratePictures, testing::ValuesIn(kMethods),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace perch
