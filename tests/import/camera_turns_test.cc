#include "perch/import/camera_turns.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch {
namespace {

const CameraModel kCamera = CameraModel::pinhole(226, 226, 159.5, 119.5, 320, 240);

// A ground of blotches of some pixels.
cv::Mat ground() {
  TestRng rng;
  cv::Mat picture(240, 320, CV_8UC1);
  for (auto it = picture.begin<uchar>(); it != picture.end<uchar>(); ++it)
    *it = static_cast<uchar>(rng.index(256));
  cv::GaussianBlur(picture, picture, {}, 2.5);
  cv::normalize(picture, picture, 40, 200, cv::NORM_MINMAX);
  return picture;
}

// The same ground, a plane with that normal, after the camera turned (begin_from_end = Exp(turn)) and moved
// by `moved` of its distance.
cv::Mat seen_after(const cv::Mat& picture, const Eigen::Vector3d& turn, const Eigen::Vector3d& moved,
                   const Eigen::Vector3d& normal) {
  const Eigen::Matrix3d end_from_begin = so3_exp(turn).conjugate().toRotationMatrix();
  const Eigen::Matrix3d H =
      end_from_begin * (Eigen::Matrix3d::Identity() - moved * normal.normalized().transpose());
  Eigen::Matrix3d K;
  K << 226, 0, 159.5, 0, 226, 119.5, 0, 0, 1;
  const Eigen::Matrix3d pixels = K * H * K.inverse();
  cv::Mat matrix(3, 3, CV_64F), after;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) matrix.at<double>(r, c) = pixels(r, c);
  cv::warpPerspective(picture, after, matrix, picture.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  return after;
}

TEST(TurnByTracks, IsTheTurnAlone) {
  const cv::Mat before = ground();
  const Eigen::Vector3d ahead(0, 0, 1), tilted(0.1, -0.25, 1);
  const Eigen::Vector3d turn(0.01, -0.02, 0.015), none = Eigen::Vector3d::Zero();
  struct Case {
    Eigen::Vector3d turn, moved, normal;
  };
  for (const Case& c : {Case{turn, none, ahead}, Case{none, none, ahead}, Case{none, {0.05, 0, 0}, ahead},
                        Case{turn, {0.05, 0.02, 0}, ahead}, Case{turn, {0.04, -0.03, 0.02}, tilted},
                        Case{none, {0, 0.05, 0}, tilted}}) {
    const auto found = turn_by_tracks(before, seen_after(before, c.turn, c.moved, c.normal), kCamera);
    ASSERT_TRUE(found);
    // A tenth of a pixel is 4e-4 rad; what tells a turn from a move are terms of second order, in this lens a
    // fifth of the first's. Taking the move for a turn would be off by 0.05.
    EXPECT_LT((*found - c.turn).norm(), 0.004) << c.moved.transpose() << "; " << c.normal.transpose();
  }
}

TEST(TurnByTracks, SaysNothingOfWhatHasNoFeaturesOrIsAnotherPlace) {
  const cv::Mat before = ground();
  cv::Mat elsewhere;
  cv::flip(before, elsewhere, 0);
  EXPECT_FALSE(turn_by_tracks(before, elsewhere, kCamera));
  EXPECT_FALSE(turn_by_tracks(cv::Mat(240, 320, CV_8UC1, cv::Scalar(80)), before, kCamera));
}

}  // namespace
}  // namespace perch
