// Straight edges between two levels, blurred exactly, under light that changes, with noise.

#include "perch/detection/edge_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "support/rng.h"

namespace perch {
namespace {

constexpr int kSize = 160;

struct Bands {
  double angle = 0.3, phase = 0;  // of the stripes
  int width = 24;                 // of them, px
  double blur = 0.75;             // px
  double slope = 0;               // of the light, a px
  double shade = 1;               // what a shadow leaves of it beside the middle
  double shadow_angle = 0;        // of its edge, 8 px wide
  double noise = 0;               // grey levels
};

// White and black stripes, their edges at phase + width k along the direction of `angle`.
double distance(const Bands& b, double x, double y) {
  return std::cos(b.angle) * (x - kSize / 2) + std::sin(b.angle) * (y - kSize / 2) - b.phase;
}

// 1 in the light, `shade` in the shadow.
double in_shadow(const Bands& b, const Eigen::Vector2d& p) {
  const double out =
      std::cos(b.shadow_angle) * (p.x() - kSize / 2) + std::sin(b.shadow_angle) * (p.y() - kSize / 2);
  return b.shade + (1 - b.shade) * std::clamp(out / 8 + 0.5, 0.0, 1.0);
}

cv::Mat paint(const Bands& b, TestRng& rng) {
  cv::Mat picture(kSize, kSize, CV_8UC1);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double d = distance(b, x, y);
      double white = 0;
      const int most = 2 * (72 / b.width);
      for (int k = -most; k <= most; k += 2) {
        white += 0.5 * (std::erf((d - b.width * k) / b.blur / M_SQRT2) -
                        std::erf((d - b.width * (k + 1)) / b.blur / M_SQRT2));
      }
      const double light = (1 + b.slope * (x - kSize / 2)) * in_shadow(b, {x, y});
      const double level = light * (20 + 120 * white) + rng.normal(b.noise) + rng.uniform(-0.5, 0.5);
      picture.at<uint8_t>(y, x) = static_cast<uint8_t>(std::clamp(std::lround(level), 0L, 255L));
    }
  }
  return picture;
}

// Pieces on the edges of the middle stripes (five of 24 px), each as long as a stripe is wide, expected `off`
// px from where they are.
std::vector<EdgePiece> pieces_of(const Bands& b, double off) {
  std::vector<EdgePiece> pieces;
  const Eigen::Vector2d n(std::cos(b.angle), std::sin(b.angle)), along(-n.y(), n.x());
  const int stripes = 48 / b.width, parts = 24 / b.width;
  for (int k = -stripes; k <= stripes; ++k) {
    for (int part = -parts; part <= parts; ++part) {
      EdgePiece p;
      p.middle =
          Eigen::Vector2d::Constant(kSize / 2) + (b.phase + b.width * k + off) * n + b.width * part * along;
      p.begin = p.middle - 0.5 * b.width * along;
      p.end = p.middle + 0.5 * b.width * along;
      p.normal = k % 2 == 0 ? n : Eigen::Vector2d(-n);  // towards white
      p.gradient = p.normal;
      p.white_room = p.black_room = b.width;
      pieces.push_back(p);
    }
  }
  return pieces;
}

struct Errors {
  double rms = 0, mean = 0, chi_square = 0, median_px = 0;  // the median as a deviation
  double gain = 0;  // of the offset that is measured by that which is there, above 1
  size_t count = 0;
};

// Over many pictures: of each edge's place along n, px.
Errors measure(Bands b, double expected_blur, int pictures, double most_off = 0.4) {
  TestRng rng;
  EdgeFit fit;
  std::vector<EdgeOffset> offsets;
  std::vector<int> measured;
  Errors errors;
  std::vector<double> sizes;
  double squares = 0;
  for (int i = 0; i < pictures; ++i) {
    b.angle = rng.uniform(-3, 3);
    b.phase = rng.uniform(-12, 12);
    b.shadow_angle = rng.uniform(-3, 3);
    const double off = rng.uniform(-most_off, most_off);
    const auto pieces = pieces_of(b, off);
    const std::vector<uint8_t> on_ground(pieces.size(), 0);
    fit.measure(paint(b, rng), pieces, on_ground, {}, {1000, expected_blur, 12}, offsets, measured);
    for (size_t k = 0; k < offsets.size(); ++k) {
      const double sense = pieces[static_cast<size_t>(measured[k])].normal.dot(
          Eigen::Vector2d(std::cos(b.angle), std::sin(b.angle)));
      const double error = offsets[k].offset + sense * off;
      errors.rms += error * error;
      errors.mean += error;
      errors.gain -= error * sense * off;
      squares += off * off;
      errors.chi_square += std::pow(error / offsets[k].sigma, 2);
      sizes.push_back(std::abs(error));
      ++errors.count;
    }
  }
  const auto n = static_cast<double>(errors.count);
  errors.rms = std::sqrt(errors.rms / n);
  errors.mean /= n;
  errors.gain /= squares;
  errors.chi_square /= n;
  std::ranges::nth_element(sizes, sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2));
  errors.median_px = 1.4826 * sizes[sizes.size() / 2];
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

// A pose that was started from a twentieth of a pixel away would be off by some thousandths: more than the
// sigma of one seen from near. A step sharper than the templates' would be measured as farther by 4 % at 0.7
// px.
TEST(EdgeFit, AnOffsetKeepsItsSizeWhateverBlurWasExpected) {
  for (const double expected : {0.68, 0.7, 0.73, 0.75, 0.77, 0.8, 0.83}) {
    const Errors errors = measure({.blur = 0.75, .noise = 0.3}, expected, 60, 0.14);
    std::printf("%.2f: %.4f\n", expected, errors.gain);
    EXPECT_LT(std::abs(errors.gain), 0.01) << expected;
  }
}

// The light on both sides is even: a surface through both would take its fall for one of the light at each
// edge, and move all of them to the same side by hundredths of a pixel. What lies in the shadow's soft edge
// is moved, and says so.
TEST(EdgeFit, AShadowShiftsNothing) {
  for (const double shade : {0.3, 0.6}) {
    const Errors errors = measure({.width = 12, .shade = shade, .noise = 1}, 0.75, 30);
    ASSERT_GT(errors.count, 1000U);
    // Half of the pieces are brighter than that, but a few levels must do for two surfaces.
    EXPECT_LT(errors.median_px, 2 * bound(1, shade * 120, 0.75, 12)) << shade;
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
