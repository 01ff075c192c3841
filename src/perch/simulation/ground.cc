#include "perch/simulation/ground.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "perch/simulation/random.h"

namespace perch {

namespace {

constexpr int kPixels = 1024;         // of the wide tile: 8 mm each
constexpr double kWideSide = 8;       // m
constexpr int kFinePixels = 256;      // of the fine tile: 3 mm each
constexpr double kFineSide = 0.77;    // no simple part of kWideSide, so that the sum repeats late
constexpr double kOctaveDecay = 0.7;  // amplitude of an octave over that of the next coarser one

// Twice the resolution, bilinear between the centres of the coarse pixels, with wrap-around.
cv::Mat_<float> doubled(const cv::Mat_<float>& coarse) {
  const int n = coarse.rows;
  cv::Mat_<float> fine(2 * n, 2 * n);
  for (int r = 0; r < 2 * n; ++r) {
    const float* near = coarse[r / 2];
    const float* far = coarse[(r / 2 + (r % 2 ? 1 : n - 1)) % n];
    float* out = fine[r];
    for (int c = 0; c < 2 * n; ++c) {
      const int here = c / 2, beside = (c / 2 + (c % 2 ? 1 : n - 1)) % n;
      out[c] = 0.5625F * near[here] + 0.1875F * (near[beside] + far[here]) + 0.0625F * far[beside];
    }
  }
  return fine;
}

// Noise with mean 0 and deviation 1, within 2.5 deviations; the coarsest octave has `first` cells across.
cv::Mat_<float> noise(int pixels, int first, RandomStream& random) {
  cv::Mat_<float> sum(first, first, 0.0F);
  double amplitude = 1;
  while (true) {
    for (float& value : sum) value += static_cast<float>(amplitude * random.uniform(-1, 1));
    if (sum.rows >= pixels) break;
    sum = doubled(sum);
    amplitude *= kOctaveDecay;
  }
  cv::Scalar mean, deviation;
  cv::meanStdDev(sum, mean, deviation);
  for (float& value : sum) {
    value = std::clamp(static_cast<float>((value - mean[0]) / deviation[0]), -2.5F, 2.5F);
  }
  return sum;
}

// A stone: a convex polygon of one brightness, whole inside the tile.
void draw_stone(cv::Mat_<float>& tile, double metres_per_pixel, double ground, RandomStream& random) {
  const double radius = random.uniform(0.03, 0.12) / metres_per_pixel;
  const double x = random.uniform(radius, tile.cols - radius), y = random.uniform(radius, tile.rows - radius);
  const double brightness = random.uniform() < 0.3 ? 0.4 * ground : random.uniform(1.5, 3.5) * ground;
  constexpr int kSides = 7;
  std::vector<cv::Point> corners;
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2 * M_PI * (i + random.uniform(0, 0.6)) / kSides;
    corners.emplace_back(cvRound(x + radius * std::cos(angle)), cvRound(y + 0.8 * radius * std::sin(angle)));
  }
  cv::fillConvexPoly(tile, corners, std::min(brightness, 0.9));
}

}  // namespace

Ground::Ground(const GroundOptions& options) {
  RandomStream random(options.seed);
  wide_.side = kWideSide;
  wide_.levels.push_back(noise(kPixels, 8, random));
  for (float& value : wide_.levels[0]) {
    value = static_cast<float>(options.reflectance * std::max(0.05, 1 + options.contrast * value));
  }
  for (int i = 0; i < options.stones; ++i) {
    draw_stone(wide_.levels[0], kWideSide / kPixels, options.reflectance, random);
  }
  wide_.add_coarser_levels();

  // The octaves below the wide tile's pixels go on at half its contrast: grains, gravel.
  fine_.side = kFineSide;
  fine_.levels.push_back(noise(kFinePixels, 64, random));
  for (float& value : fine_.levels[0]) {
    value = static_cast<float>(std::max(0.05, 1 + 0.5 * options.contrast * value));
  }
  fine_.add_coarser_levels();
}

void Ground::Tile::add_coarser_levels() {
  while (levels.back().rows > 1) {
    const cv::Mat_<float>& fine = levels.back();
    cv::Mat_<float> coarse(fine.rows / 2, fine.cols / 2);
    for (int r = 0; r < coarse.rows; ++r) {
      for (int c = 0; c < coarse.cols; ++c) {
        coarse(r, c) = 0.25F * (fine(2 * r, 2 * c) + fine(2 * r, 2 * c + 1) + fine(2 * r + 1, 2 * c) +
                                fine(2 * r + 1, 2 * c + 1));
      }
    }
    levels.push_back(coarse);
  }
}

double Ground::Tile::at(const Eigen::Vector2d& point, double size) const {
  // The level whose pixels are as large as what is averaged over: no flicker from far, detail from near.
  const double ratio = std::clamp(size * levels[0].rows / side, 1.0, 0x1p20);
  const auto level = std::min<size_t>(static_cast<size_t>(std::bit_width(static_cast<unsigned>(ratio)) - 1),
                                      levels.size() - 1);
  const cv::Mat_<float>& picture = levels[level];
  const int n = picture.rows;
  const double scale = n / side;
  const double x = point.x() * scale - 0.5, y = point.y() * scale - 0.5;  // pixel centres are whole numbers
  const double fx = std::floor(x), fy = std::floor(y);
  // n is a power of two: the mask wraps negative numbers rightly too.
  const int c0 = static_cast<int>(fx) & (n - 1), c1 = (c0 + 1) & (n - 1);
  const float* r0 = picture[static_cast<int>(fy) & (n - 1)];
  const float* r1 = picture[(static_cast<int>(fy) + 1) & (n - 1)];
  const double s = x - fx, t = y - fy;
  return (1 - t) * ((1 - s) * r0[c0] + s * r0[c1]) + t * ((1 - s) * r1[c0] + s * r1[c1]);
}

double Ground::reflectance(const Eigen::Vector2d& point, double size) const {
  return wide_.at(point, size) * fine_.at(point, size);
}

}  // namespace perch
