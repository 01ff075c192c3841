#include "perch/detection/tag_border.h"

#include <gtest/gtest.h>

#include "perch/target/tag_family.h"
#include "support/printed_tags.h"

namespace perch {
namespace {

// A tag of 8 x 8 modules, 10 px each, its centre at (100, 100).
const Eigen::Matrix3d kPixelFromTag = (Eigen::Matrix3d() << 40, 0, 100, 0, 40, 100, 0, 0, 1).finished();

cv::Mat one_tag() {
  cv::Mat picture(200, 200, CV_8UC1, cv::Scalar(110));
  const TagFamily family = make_tag_family("tag36h11");
  paint_tag(picture, printed_tag(family.get(), 7, 1), 8, {7, 2, {0, 0}, 0}, kPixelFromTag);
  return picture;
}

TEST(TagBorder, AgreesWithItsOwnCorners) {
  EXPECT_EQ(border_agreement(one_tag(), kPixelFromTag, 8, true), 1.0);
}

TEST(TagBorder, DisagreesWithOneCornerInTheBlackSquareBesideIt) {
  const std::vector<Eigen::Vector2d> tag{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  const std::vector<Eigen::Vector2d> pixels{{155, 155}, {60, 140}, {60, 60}, {140, 60}};  // 15 px outwards
  cv::Mat picture = one_tag();
  picture(cv::Rect(140, 140, 25, 25)) = 30;
  EXPECT_EQ(border_agreement(picture, kPixelFromTag, 8, true), 1.0)
      << "the black square alone does not matter";
  EXPECT_LE(border_agreement(picture, *homography_from_points(tag, pixels), 8, true), 0.85);
}

TEST(TagBorder, IsNotMisledByAShadow) {
  cv::Mat picture = one_tag();
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      if (3 * u + v < 380) picture.at<uchar>(v, u) = static_cast<uchar>(picture.at<uchar>(v, u) / 6);
    }
  }
  // The shadow's own edge crosses the border twice.
  EXPECT_GE(border_agreement(picture, kPixelFromTag, 8, true), 0.93);
}

TEST(TagBorder, ToldTheWrongColourDoesNotAgree) {
  EXPECT_EQ(border_agreement(one_tag(), kPixelFromTag, 8, false), 0.0);
}

TEST(TagBorder, OutsideOfThePictureIsNoBorder) {
  Eigen::Matrix3d beyond = kPixelFromTag;
  beyond(0, 2) = 1000;
  EXPECT_EQ(border_agreement(one_tag(), beyond, 8, true), 0.0);
  beyond(0, 2) = std::nan("");
  EXPECT_EQ(border_agreement(one_tag(), beyond, 8, true), 0.0);
}

}  // namespace
}  // namespace perch
