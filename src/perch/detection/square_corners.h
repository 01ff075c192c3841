#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perch/detection/components.h"
#include "perch/detection/labelling.h"
#include "perch/detection/runs.h"

namespace perch {

// The paper's section 2.1.3 at full resolution: the corners of a white square that was found in every
// `row_step`-th row. Its left and right edge are followed from row to
// row; to threshold and label its neighbourhood anew gives the same, at six times the cost. Holds its working
// memory.
class SquareCorners {
 public:
  // What a square has of one row: from its first to its last white pixel. What is between them, a nested
  // target's hole or noise, is inside.
  struct Span {
    int begin = 0, end = 0;  // columns, [begin, end)
    bool empty() const { return begin == end; }
  };

  // `square` is a component of `sampled`, which has every `row_step`-th row of `grey` at this level. Empty
  // when it has no four corners, or these do not explain its area.
  std::optional<SeenSquare> measure(const cv::Mat& grey, uint8_t level, int row_step, const RunImage& sampled,
                                    const Component& square);

 private:
  std::vector<Span> spans_;              // by row
  std::vector<cv::Point> left_, right_;  // the sides of its convex outline
  std::vector<Eigen::Vector2d> outline_;
};

}  // namespace perch
