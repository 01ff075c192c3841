#pragma once

#include <apriltag/apriltag.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "perch/geometry/homography.h"
#include "perch/target/landing_target.h"
#include "support/aprilgrid.h"

namespace perch {

// A tag as libapriltag prints it, one pixel a module, with its white surroundings, and the border `border`
// modules wide. libapriltag draws the tag itself: how it lies is its word, not ours.
inline cv::Mat printed_tag(apriltag_family_t* family_of_border_1, int id, int border) {
  image_u8_t* image = apriltag_to_image(family_of_border_1, static_cast<uint32_t>(id));
  const cv::Mat whole =
      cv::Mat(image->height, image->width, CV_8UC1, image->buf, static_cast<size_t>(image->stride)).clone();
  // What image_u8_destroy does, which Debian's library keeps to itself.
  std::free(image->buf);
  std::free(image);
  if (border == 1) return whole;
  const cv::Mat data = whole(cv::Rect(2, 2, whole.cols - 4, whole.rows - 4)).clone();
  cv::Mat wide;
  cv::copyMakeBorder(data, wide, border, border, border, border, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::copyMakeBorder(wide, wide, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(255));
  return wide;
}

// Paints a tag into a grey picture: pixel_from_target maps the target's plane to pixels. Each pixel is the
// mean of 4 x 4 samples of what is printed.
inline void paint_tag(cv::Mat& picture, const cv::Mat& printed, int width_at_border, const Tag& tag,
                      const Eigen::Matrix3d& pixel_from_target, double black = 30, double white = 210) {
  const double module = tag.size / width_at_border;
  const double half = module * printed.cols / 2;
  const Eigen::Matrix3d target_from_pixel = pixel_from_target.inverse();
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  for (int k = 0; k < 4; ++k) {
    Tag outer = tag;
    outer.size = 2 * half;
    const Eigen::Array2d pixel = apply(pixel_from_target, tag_corner(outer, k)).array();
    low = low.min(pixel), high = high.max(pixel);
  }
  constexpr int kSamples = 4;
  for (int v = std::max(0, static_cast<int>(low.y()) - 1);
       v <= std::min<double>(picture.rows - 1, high.y() + 1); ++v) {
    for (int u = std::max(0, static_cast<int>(low.x()) - 1);
         u <= std::min<double>(picture.cols - 1, high.x() + 1); ++u) {
      double sum = 0;
      for (int s = 0; s < kSamples * kSamples; ++s) {
        const Eigen::Vector2d pixel(u - 0.5 + (s % kSamples + 0.5) / kSamples,
                                    v - 0.5 + (s / kSamples + 0.5) / kSamples);
        const Eigen::Vector2d p =
            Eigen::Rotation2Dd(-tag.yaw) * (apply(target_from_pixel, pixel) - tag.centre);
        const int column = static_cast<int>(std::floor((p.x() + half) / module));
        const int row =
            static_cast<int>(std::floor((half - p.y()) / module));  // printed row 0 is the upper one
        const bool inside = column >= 0 && row >= 0 && column < printed.cols && row < printed.rows;
        sum += inside ? (printed.at<uchar>(row, column) ? white : black) : picture.at<uchar>(v, u);
      }
      picture.at<uchar>(v, u) = cv::saturate_cast<uchar>(sum / (kSamples * kSamples));
    }
  }
}

}  // namespace perch
