#pragma once

#include <vector>

#include "perch/detection/confirm.h"
#include "perch/detection/grey_order.h"
#include "perch/detection/hypotheses.h"
#include "perch/detection/quads.h"
#include "perch/detection/segmentation.h"
#include "perch/detection/stopwatch.h"
#include "perch/detection/target_area.h"

namespace perch {

// Looks for targets in the regions of a picture: white ones in black suggest homographies, which the picture
// confirms or not. Holds its working memory.
class RegionSearch {
 public:
  RegionSearch(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera,
               double min_found, double min_contrast);

  // How a segmentation came to be.
  struct Regions {
    int row_step = 1;                // of its rows
    bool is_measured_after = false;  // see Requirement
    bool pooled = false;  // squares count together whatever black they lie in: a shadow's edge may part it
  };
  // Adds every target that is confirmed and not among those `found` before.
  void search(const cv::Mat& grey, const Segmentation& segmentation, const Regions& regions,
              Stopwatch& stopwatch, std::vector<Confirmed>& found);

 private:
  // Regions that may be squares of one target: a part of `order_`.
  struct Group {
    size_t first = 0, count = 0;
    double largest = 0;  // px
  };
  struct Picture {
    const cv::Mat& grey;
    const Segmentation& segmentation;
    int row_step;
  };
  void make_groups(bool pooled);
  bool is_quad(const Picture& picture, WhiteQuad& quad);
  bool is_known(const Eigen::Vector2d& pixel) const;
  void search_group(const Picture& picture, const Group& group, Stopwatch& stopwatch,
                    std::vector<Confirmed>& found);
  int squares_of(const Confirmed& found) const;
  bool outdoes(const Confirmed& best, const std::optional<Confirmed>& rival) const;
  bool is_sure_enough(const Confirmed& found, double in_order) const;
  bool try_hypotheses(const Picture& picture, std::vector<Confirmed>& found);

  LandingTarget target_;
  TargetEdges edges_;
  CameraModel camera_;
  Requirement requirement_;
  size_t squares_;  // of the layout
  Hypotheses hypotheses_;
  GreyOrder grey_order_;
  Confirmation confirmation_;

  int tries_ = 0;  // left
  std::vector<WhiteQuad> quads_;
  QuadTracer tracer_;
  std::vector<size_t> order_, members_;
  std::vector<Group> groups_;
  std::vector<TargetArea> areas_;  // of those that were found
  std::vector<Hypothesis> proposed_;
};

}  // namespace perch
