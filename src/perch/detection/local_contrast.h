#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "perch/detection/runs.h"

namespace perch {

// A threshold for every tile of 8x8 px, halfway between the darkest and the brightest pixel around it, for
// pictures in which none fits all: hard shadows, glare. "Around" is as near as contrast allows: the tile and
// its neighbours if what differs there is at least a quarter of what differs twice as far around, else what
// holds there; so the inside of a large white square is white although nothing in it is dark.
class LocalContrast {
 public:
  // Black and white of every row of `grey` (CV_8UC1, not empty). Where nothing differs by twice
  // `min_contrast`, all is black.
  void threshold(const cv::Mat& grey, double min_contrast, RunImage& image);

 private:
  struct Tile {
    uint8_t low = 255, high = 0;
  };
  struct Level {
    int columns = 0, rows = 0;
    std::vector<Tile> tiles, around;  // around: over 3x3 tiles
    std::vector<Tile> chosen;         // low: the threshold, high: the contrast that it rests on
  };
  void measure_tiles(const cv::Mat& grey);
  void choose(double min_contrast);

  std::vector<Level> levels_;  // tiles of 8, 16, 32, ... px
  std::vector<uint8_t> row_;   // a threshold for each pixel of a row of tiles
};

}  // namespace perch
