#include "perch/detection/local_contrast.h"

#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>

namespace perch {
namespace {

constexpr int kTile = 8;  // px

// Both ends of 8 bytes.
template <typename T>
void grow(T& tile, const T& by) {
  tile.low = std::min(tile.low, by.low);
  tile.high = std::max(tile.high, by.high);
}

}  // namespace

void LocalContrast::measure_tiles(const cv::Mat& grey) {
  levels_.resize(std::max<size_t>(levels_.size(), 1));
  Level& finest = levels_[0];
  finest.columns = (grey.cols + kTile - 1) / kTile;
  finest.rows = (grey.rows + kTile - 1) / kTile;
  finest.tiles.assign(static_cast<size_t>(finest.columns) * static_cast<size_t>(finest.rows), {});
  for (int y = 0; y < finest.rows; ++y) {
    Tile* tiles = finest.tiles.data() + static_cast<size_t>(y) * static_cast<size_t>(finest.columns);
    const int last = std::min(kTile * (y + 1), grey.rows);
    int x = 0;
    for (; kTile * x + 16 <= grey.cols; x += 2) {
      cv::v_uint8x16 low = cv::v_setall_u8(255), high = cv::v_setall_u8(0);
      for (int v = kTile * y; v < last; ++v) {
        const cv::v_uint8x16 pixels = cv::v_load(grey.ptr<uint8_t>(v) + kTile * x);
        low = cv::v_min(low, pixels);
        high = cv::v_max(high, pixels);
      }
      uint8_t lows[16], highs[16];
      cv::v_store(lows, low);
      cv::v_store(highs, high);
      for (int k = 0; k < 2; ++k) {
        tiles[x + k] = {*std::min_element(lows + kTile * k, lows + kTile * (k + 1)),
                        *std::max_element(highs + kTile * k, highs + kTile * (k + 1))};
      }
    }
    for (; x < finest.columns; ++x) {
      for (int v = kTile * y; v < last; ++v) {
        const uint8_t* row = grey.ptr<uint8_t>(v);
        for (int u = kTile * x; u < std::min(kTile * (x + 1), grey.cols); ++u)
          grow(tiles[x], Tile{row[u], row[u]});
      }
    }
  }
  size_t count = 1;
  while (levels_[count - 1].columns > 1 || levels_[count - 1].rows > 1) {
    levels_.resize(std::max(levels_.size(), count + 1));
    const Level& fine = levels_[count - 1];
    Level& coarse = levels_[count++];
    coarse.columns = (fine.columns + 1) / 2;
    coarse.rows = (fine.rows + 1) / 2;
    coarse.tiles.assign(static_cast<size_t>(coarse.columns) * static_cast<size_t>(coarse.rows), {});
    for (int y = 0; y < fine.rows; ++y) {
      for (int x = 0; x < fine.columns; ++x) {
        grow(coarse.tiles[static_cast<size_t>(y / 2 * coarse.columns + x / 2)],
             fine.tiles[static_cast<size_t>(y * fine.columns + x)]);
      }
    }
  }
  levels_.resize(count);
  for (Level& level : levels_) {
    level.around.assign(level.tiles.size(), {});
    for (int y = 0; y < level.rows; ++y) {
      for (int x = 0; x < level.columns; ++x) {
        Tile& around = level.around[static_cast<size_t>(y * level.columns + x)];
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, level.rows - 1); ++v) {
          for (int u = std::max(x - 1, 0); u <= std::min(x + 1, level.columns - 1); ++u) {
            grow(around, level.tiles[static_cast<size_t>(v * level.columns + u)]);
          }
        }
      }
    }
  }
}

void LocalContrast::choose(double min_contrast) {
  const int least = static_cast<int>(2 * min_contrast);
  for (size_t k = levels_.size(); k-- > 0;) {
    Level& level = levels_[k];
    level.chosen.assign(level.tiles.size(), {});
    for (int y = 0; y < level.rows; ++y) {
      for (int x = 0; x < level.columns; ++x) {
        const auto i = static_cast<size_t>(y * level.columns + x);
        const Tile& around = level.around[i];
        const int contrast = around.high - around.low;
        Tile above{255, 0};
        if (k + 1 < levels_.size()) {
          const Level& coarse = levels_[k + 1];
          above = coarse.chosen[static_cast<size_t>(y / 2 * coarse.columns + x / 2)];
        }
        const bool own = contrast >= least && 4 * contrast >= above.high;
        level.chosen[i] =
            own ? Tile{static_cast<uint8_t>((around.low + around.high) / 2), static_cast<uint8_t>(contrast)}
                : above;
      }
    }
  }
}

void LocalContrast::threshold(const cv::Mat& grey, double min_contrast, RunImage& image) {
  measure_tiles(grey);
  choose(min_contrast);
  image.width = grey.cols;
  image.rows.clear();
  image.runs.clear();
  const Level& finest = levels_[0];
  row_.resize(static_cast<size_t>(kTile * finest.columns));
  for (int y = 0; y < grey.rows; ++y) {
    if (y % kTile == 0) {
      const Tile* tiles =
          finest.chosen.data() + static_cast<size_t>(y / kTile) * static_cast<size_t>(finest.columns);
      for (int x = 0; x < finest.columns; ++x) {
        std::fill_n(row_.data() + kTile * x, kTile, tiles[x].low);
      }
    }
    append_row(grey.ptr<uint8_t>(y), row_.data(), image);
  }
}

}  // namespace perch
