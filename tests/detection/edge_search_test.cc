// A blurred step at every angle and place between pixels: where it is found, and how blurred.

#include "perch/detection/edge_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/core.hpp>

#include "support/rng.h"

namespace perch {
namespace {

constexpr int kSize = 64;

// Dark on one side of a line through the middle, `off` px along its normal, light on the other.
cv::Mat step(const Eigen::Vector2d& normal, double off, double blur, double noise, TestRng& rng) {
  cv::Mat picture(kSize, kSize, CV_8UC1);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double d = normal.dot(Eigen::Vector2d(x - kSize / 2, y - kSize / 2)) - off;
      const double white = 0.5 + 0.5 * std::erf(d / blur / M_SQRT2);
      const double level = 40 + 120 * white + rng.normal(noise);
      picture.at<uint8_t>(y, x) = static_cast<uint8_t>(std::clamp(std::lround(level), 0L, 255L));
    }
  }
  return picture;
}

EdgePiece expected(const Eigen::Vector2d& normal) {
  EdgePiece piece;
  const Eigen::Vector2d along(-normal.y(), normal.x());
  piece.middle = Eigen::Vector2d::Constant(kSize / 2);
  piece.begin = piece.middle - 12 * along;
  piece.end = piece.middle + 12 * along;
  piece.normal = piece.gradient = normal;
  piece.white_room = piece.black_room = 20;
  return piece;
}

struct Found {
  double place_rms = 0, blur = 0;  // px; the median
  int found = 0, asked = 0;
};

Found search(double blur, double noise) {
  TestRng rng;
  Found all;
  std::vector<EdgeOffset> offsets;
  std::vector<FoundStep> steps;
  std::vector<double> widths;
  for (int picture = 0; picture < 60; ++picture) {
    const double angle = rng.uniform(0, 2 * M_PI), off = rng.uniform(-2, 2);
    const Eigen::Vector2d normal(std::cos(angle), std::sin(angle));
    const EdgePiece piece = expected(normal);
    std::vector<EdgeTally> tallies(1);
    search_edges(step(normal, off, blur, noise, rng), std::span(&piece, 1), {}, {.radius = 4, .lines = 6},
                 offsets, steps, tallies);
    all.found += tallies[0].found;
    all.asked += tallies[0].asked;
    for (const EdgeOffset& o : offsets) all.place_rms += (o.offset - off) * (o.offset - off);
    for (const FoundStep& s : steps) widths.push_back(s.width);
  }
  all.place_rms = std::sqrt(all.place_rms / all.found);
  std::ranges::nth_element(widths, widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2));
  all.blur = widths[widths.size() / 2];
  return all;
}

// The fine fit takes a blur for the expected one within 15 %; half of that is left for what noise does.
TEST(EdgeSearch, FindsPlaceAndBlurOfAStep) {
  for (const double blur : {0.6, 0.75, 1.0, 1.4}) {
    const Found clean = search(blur, 0);
    std::printf("blur %.2f px: %.3f, place to %.3f px\n", blur, clean.blur, clean.place_rms);
    EXPECT_EQ(clean.found, clean.asked);
    EXPECT_NEAR(clean.blur, blur, 0.09 * blur);
    EXPECT_LT(clean.place_rms, 0.1);
    const Found noisy = search(blur, 2);
    EXPECT_EQ(noisy.found, noisy.asked);
    EXPECT_NEAR(noisy.blur, blur, 0.12 * blur);
    EXPECT_LT(noisy.place_rms, 0.2);
  }
}

}  // namespace
}  // namespace perch
