#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace perch {

// A binary picture as runs: each row is cut into pieces of alternating colour, which together cover it.
//
//   row:  ....####..##    runs: [0,4) black, [4,8) white, [8,10) black, [10,12) white
struct Run {
  int begin = 0, end = 0;  // columns, [begin, end)
  int label = 0;           // the component it belongs to, once labelled
};

struct RunImage {
  struct Row {
    int first = 0;             // index of its first run
    int count = 0;             // at least 1
    bool first_white = false;  // colour of the first run
  };
  int width = 0;
  std::vector<Row> rows;
  std::vector<Run> runs;
  std::vector<int> ends;  // working memory of threshold_to_runs

  bool is_white(const Row& row, int k) const { return row.first_white != ((k & 1) != 0); }
};

// The label of a pixel's run; x and y inside the picture.
inline int label_at(const RunImage& image, int x, int y) {
  const RunImage::Row& row = image.rows[static_cast<size_t>(y)];
  const Run* first = image.runs.data() + row.first;
  return std::upper_bound(first, first + row.count, x,
                          [](int column, const Run& run) { return column < run.end; })
      ->label;
}

// Thresholds every `row_step`-th row of a grey picture (CV_8UC1, not empty): white where grey > level.
// Columns are not skipped: a row costs the same bits however many of them are looked at. `image` keeps its
// memory.
void threshold_to_runs(const cv::Mat& grey, uint8_t level, int row_step, RunImage& image);

// Appends a row of `image.width` pixels, white where a pixel is above its own level.
void append_row(const uint8_t* pixels, const uint8_t* levels, RunImage& image);

}  // namespace perch
