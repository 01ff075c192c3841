#pragma once

#include "perch/target/landing_target.h"

namespace perch {

// The corner k of a tag in the target frame, in the order of LandingTarget's features.
inline Eigen::Vector2d tag_corner(const Tag& tag, int k) {
  const Eigen::Vector2d signs[] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  return tag.centre + Eigen::Rotation2Dd(tag.yaw) * (tag.size / 2 * signs[k]);
}

// The board of shared/flights/real_mocap: 6 x 6 tags, ids row by row from the lower left, origin at the
// lower-left corner of tag 0.
inline AprilTagBoard real_mocap_board() {
  AprilTagBoard board{"tag36h11", 2, {}};
  constexpr double kTag = 0.088, kGap = 0.0264;  // m
  for (int id = 0; id < 36; ++id) {
    const Eigen::Vector2d lower_left = (kTag + kGap) * Eigen::Vector2d(id % 6, id / 6);
    board.tags.push_back({id, kTag, lower_left + Eigen::Vector2d(kTag / 2, kTag / 2), 0});
  }
  return board;
}

}  // namespace perch
