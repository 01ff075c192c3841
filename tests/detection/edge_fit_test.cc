// Straight edges between two levels, blurred exactly, under light that changes, with noise.

#include "perch/detection/edge_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "support/rng.h"

namespace perch {
namespace {

constexpr int kSize = 160;

struct Bands {
  double angle = 0.3, phase = 0;  // of the stripes
  double blur = 0.75;             // px
  double slope = 0;               // of the light, a px
  double noise = 0;               // grey levels
};

// White and black stripes 24 px wide, their edges at phase + 24 k along the direction of `angle`.
double distance(const Bands& b, double x, double y) {
  return std::cos(b.angle) * (x - kSize / 2) + std::sin(b.angle) * (y - kSize / 2) - b.phase;
}

cv::Mat paint(const Bands& b, TestRng& rng) {
  cv::Mat picture(kSize, kSize, CV_8UC1);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double d = distance(b, x, y);
      double white = 0;
      for (int k = -6; k <= 6; k += 2) {
        white += 0.5 * (std::erf((d - 24 * k) / b.blur / M_SQRT2) -
                        std::erf((d - 24 * (k + 1)) / b.blur / M_SQRT2));
      }
      const double light = 1 + b.slope * (x - kSize / 2);
      const double level = light * (20 + 120 * white) + rng.normal(b.noise) + rng.uniform(-0.5, 0.5);
      picture.at<uint8_t>(y, x) = static_cast<uint8_t>(std::clamp(std::lround(level), 0L, 255L));
    }
  }
  return picture;
}

// Pieces on the edges of the five middle stripes, expected `off` px from where they are.
std::vector<EdgePiece> pieces_of(const Bands& b, double off) {
  std::vector<EdgePiece> pieces;
  const Eigen::Vector2d n(std::cos(b.angle), std::sin(b.angle)), along(-n.y(), n.x());
  for (int k = -2; k <= 2; ++k) {
    for (int part = -1; part <= 1; ++part) {
      EdgePiece p;
      p.middle = Eigen::Vector2d::Constant(kSize / 2) + (b.phase + 24 * k + off) * n + 24 * part * along;
      p.begin = p.middle - 12 * along;
      p.end = p.middle + 12 * along;
      p.normal = k % 2 == 0 ? n : Eigen::Vector2d(-n);  // towards white
      p.gradient = p.normal;
      p.white_room = p.black_room = 24;
      pieces.push_back(p);
    }
  }
  return pieces;
}

struct Errors {
  double rms = 0, mean = 0, chi_square = 0;
  size_t count = 0;
};

// Over many pictures: of each edge's place along n, px.
Errors measure(Bands b, double expected_blur, int pictures) {
  TestRng rng;
  EdgeFit fit;
  std::vector<EdgeOffset> offsets;
  std::vector<int> measured;
  Errors errors;
  for (int i = 0; i < pictures; ++i) {
    b.angle = rng.uniform(-3, 3);
    b.phase = rng.uniform(-12, 12);
    const double off = rng.uniform(-0.4, 0.4);
    const auto pieces = pieces_of(b, off);
    const std::vector<uint8_t> on_ground(pieces.size(), 0);
    fit.measure(paint(b, rng), pieces, on_ground, {}, {1000, expected_blur, 12}, offsets, measured);
    for (size_t k = 0; k < offsets.size(); ++k) {
      const double sense = pieces[static_cast<size_t>(measured[k])].normal.dot(
          Eigen::Vector2d(std::cos(b.angle), std::sin(b.angle)));
      const double error = offsets[k].offset + sense * off;
      errors.rms += error * error;
      errors.mean += error;
      errors.chi_square += std::pow(error / offsets[k].sigma, 2);
      ++errors.count;
    }
  }
  const auto n = static_cast<double>(errors.count);
  errors.rms = std::sqrt(errors.rms / n);
  errors.mean /= n;
  errors.chi_square /= n;
  return errors;
}

// A line's deviation with known levels is noise / contrast * sqrt(2 sqrt(pi) blur).
double bound(double noise, double contrast, double blur, double length) {
  return std::hypot(noise, 0.41) / contrast * std::sqrt(2 * std::sqrt(M_PI) * blur / length);
}

TEST(EdgeFit, IsNearlyAsGoodAsThePictureAllows) {
  const Errors errors = measure({.noise = 2}, 0.75, 60);
  ASSERT_GT(errors.count, 850U);
  // 24 px long; a quarter more for levels that only 15 pieces tell.
  EXPECT_LT(errors.rms, 1.25 * bound(2, 120, 0.75, 24));
  EXPECT_NEAR(errors.chi_square, 1, 0.2);  // 0.05 of scatter; the variance of each is known to a tenth
}

// An error of the level on one side shifts an edge by 0.01 px a grey level: light that falls off by a fifth
// over the target would shift all white edges inwards, were it not known from all of them.
TEST(EdgeFit, LightThatFallsOffShiftsNothing) {
  const Errors errors = measure({.slope = 2e-3, .noise = 0.5}, 0.75, 60);
  EXPECT_LT(std::abs(errors.mean), 0.0005);
  EXPECT_LT(errors.rms, 2 * bound(0.5, 120, 0.75, 24));
}

// In the mean; where all lines of a piece meet the pixels alike, to a hundredth of a pixel or two, which the
// next look with the blur that was found does not leave.
TEST(EdgeFit, ABlurThatIsExpectedWrongShiftsNothing) {
  for (const double expected : {0.6, 0.7, 0.75, 0.8, 0.95}) {
    const Errors errors = measure({.blur = 0.75, .noise = 0.5}, expected, 40);
    EXPECT_LT(std::abs(errors.mean), 0.001) << expected;
    EXPECT_LT(errors.rms, std::abs(expected - 0.75) > 0.03 ? 0.02 : 2 * bound(0.5, 120, 0.75, 24))
        << expected;
  }
}

TEST(EdgeFit, MeasuresNothingWhereNothingIs) {
  TestRng rng;
  Bands bands{.noise = 3};
  cv::Mat grey = paint(bands, rng);
  grey.setTo(90);
  EdgeFit fit;
  std::vector<EdgeOffset> offsets;
  std::vector<int> measured;
  const auto pieces = pieces_of(bands, 0);
  const std::vector<uint8_t> on_ground(pieces.size(), 0);
  fit.measure(grey, pieces, on_ground, {}, {}, offsets, measured);
  EXPECT_TRUE(offsets.empty());
  // The wrong way round.
  cv::Mat negative = 255 - paint(bands, rng);
  fit.measure(negative, pieces, on_ground, {}, {}, offsets, measured);
  EXPECT_TRUE(offsets.empty());
}

}  // namespace
}  // namespace perch
