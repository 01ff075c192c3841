#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace perch {

// How much of a detected tag's border is where its corners say: the fraction of places along its four edges,
// two for each module, whose contrast (outside - inside) / (outside + inside), half a module to either side,
// is at least half of the median one. A ratio, so that a shadow across the tag does not count. libapriltag
// also decodes a tag with one corner several pixels off, in a black neighbour that touches it: there the
// edges leave the border, into white.
//
//      . . . . . .         . outside   # inside, or the other way round with a white border
//    . # # # # # # .       corners are left out: what lies there may be black (Kalibr's grids) or a data bit
//    . #
//
// `pixel_from_tag` maps the square of the edges, (-1, -1) to (1, 1), to pixels of `grey` (CV_8UC1), `modules`
// is its width. 0 when the border is nowhere in the picture.
double border_agreement(const cv::Mat& grey, const Eigen::Matrix3d& pixel_from_tag, int modules,
                        bool black_border);

}  // namespace perch
