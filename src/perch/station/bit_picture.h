#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace perch {

// A black-and-white picture in few bytes, as the paper sent its own: one bit a pixel, or the runs where those
// are shorter.
//
//   u16 width | u16 height | u8 kind | data       little-endian
//   kind 0   bits: 8 pixels a byte, the first the highest, white 1; row after row without gaps
//   kind 1   runs: lengths of black, white, black, ... over all rows, each in groups of 7 bits, the lowest
//            first, 128 added to all groups but the last
//
// `white` is CV_8UC1, white where it is not 0, of at most 65535 x 65535.
std::vector<uint8_t> pack_bits(const cv::Mat& white);

}  // namespace perch
