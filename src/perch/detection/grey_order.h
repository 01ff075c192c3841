#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/detection/edge_search.h"
#include "perch/target/edges.h"

namespace perch {

// What a hypothesis must show before its edges are worth a search: at every edge of squares, holes and the
// border's inside, the grey in the middle of the white next to it and in the middle of the black. Some 36
// pairs of pixels, where a search reads thousands.
class GreyOrder {
 public:
  GreyOrder(const TargetEdges& target, const CameraModel& camera);

  // Of the pairs that are in the picture, the part of which the white one is brighter by `contrast`; 0 where
  // these are too few to tell, or where it is less than `least` anyway. `image_from_plane` as in plane_fit.h,
  // towards the camera.
  double part_in_order(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane, double contrast,
                       double least) const;
  // What is asked for and found at each edge, 0 or more of each; of the outlines nothing.
  void judge_edges(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane, double contrast,
                   std::span<EdgeTally> tallies) const;

 private:
  struct Pair {
    Eigen::Vector2d white, black;  // m
    size_t edge = 0;
  };
  // Whether the pair is in order; empty where it is not in the picture.
  std::optional<bool> look(const cv::Mat& grey, const Eigen::Matrix3d& H, const Pair& pair,
                           double contrast) const;

  std::vector<Pair> pairs_;
  CameraModel camera_;
};

}  // namespace perch
