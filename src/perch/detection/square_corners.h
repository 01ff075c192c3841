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
// `row_step`-th row. Holds its working memory.
class SquareCorners {
 public:
  // `square` is a component of `sampled`, which has every `row_step`-th row of `grey` at this level. Empty
  // when it has no four corners, or these do not explain its area.
  std::optional<SeenSquare> measure(const cv::Mat& grey, uint8_t level, int row_step, const RunImage& sampled,
                                    const Component& square);

 private:
  RunImage window_;  // the square's neighbourhood
  Components components_;
  std::vector<Eigen::Vector2d> left_, right_;  // the outline's sides
};

}  // namespace perch
