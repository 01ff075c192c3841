#include "perch/detection/picture_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

#include "perch/detection/confirm.h"
#include "perch/detection/edge_blur.h"
#include "perch/detection/sum_in_order.h"

namespace perch {
namespace {

constexpr int kUnknowns = PictureRows::kUnknowns;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

// Cauchy's loss in deviations: 95 % efficient on Gaussian noise.
constexpr double kCauchy = 2.4;

constexpr int kMostPasses = 8;

using Four = cv::v_float32x4;

// Where a row of an upper triangle begins.
constexpr int begin_of_row(int i) { return i * PictureRows::kColumns - i * (i - 1) / 2; }

// Sums of products of rows, the residual's column with them, the upper triangle only.
class Products {
 public:
  Products() { sums_.fill(cv::v_setzero_f32()); }
  void add(const PictureRows& rows, const Four& weight) {
    // Flat pixels have nothing to say of the step, blur and growth.
    const int first = rows.flat ? PictureRows::kWhite : 0;
    Four* sum = sums_.data() + begin_of_row(first);
    for (int i = first; i < kUnknowns; ++i) {
      const Four own = weight * rows.d[static_cast<size_t>(i)];
      for (int k = i; k < PictureRows::kColumns; ++k) *sum++ += own * rows.d[static_cast<size_t>(k)];
    }
  }
  // Both are added to.
  void take(Normal& A, Unknowns& b) const {
    const Four* sum = sums_.data();
    for (int i = 0; i < kUnknowns; ++i) {
      for (int k = i; k < kUnknowns; ++k) A(i, k) = A(k, i) = static_cast<double>(sum_in_order(*sum++));
      b(i) = static_cast<double>(sum_in_order(*sum++));
    }
  }

 private:
  std::array<Four, begin_of_row(kUnknowns)> sums_;
};

}  // namespace

// What one look at all pixels gives.
struct PictureFit::Pass {
  Normal A = Normal::Zero();
  Unknowns b = Unknowns::Zero();
  double squares = 0, weights = 0;                // of pixels without ground
  double bends = 0;                               // of these, the loss's second derivatives
  double ground_squares = 0, ground_weights = 0;  // of pixels that are ground
  double neighbours = 0, pairs = 0;               // products of one pixel's with the next one's
  int crossed = 0;
};

namespace {

// Four pixels of a line, of which some may lie beyond its end.
Four grey_of(const uint8_t* line, int x, int width) {
  std::array<float, PictureRows::kPixels> grey{};
  for (int k = 0; k < PictureRows::kPixels && x + k < width; ++k) grey[static_cast<size_t>(k)] = line[x + k];
  return cv::v_load(grey.data());
}

double sum_of(const Four& mask, const Four& values) {
  return static_cast<double>(sum_in_order(mask & values));
}

int count_of(const Four& mask) { return std::popcount(static_cast<unsigned>(cv::v_signmask(mask))); }

}  // namespace

PictureFit::Pass PictureFit::take(const cv::Mat& grey, const Noise& noise, bool levels_only) {
  Pass pass;
  Products products;
  PictureRows rows;
  const Four one = cv::v_setall_f32(1), pixel = cv::v_setall_f32(static_cast<float>(noise.pixel)),
             ground = cv::v_setall_f32(static_cast<float>(noise.together * noise.ground)),
             bound = cv::v_setall_f32(static_cast<float>(1 / (kCauchy * kCauchy)));
  // Every second row is enough for levels.
  for (int y = model_.first_row(); y <= model_.last_row(); y += levels_only ? 2 : 1) {
    const uint8_t* line = grey.ptr<uint8_t>(y);
    // Of the pixel before; zero where it is not of the target.
    std::array<float, PictureRows::kPixels + 1> errs{};
    int on_target_bits = 0;
    for (int x = model_.first_column(); x <= model_.last_column(); x += PictureRows::kPixels) {
      if (!model_.rows_of(x, y, grey_of(line, x, grey.cols), rows)) {
        errs.back() = 0;
        on_target_bits = 0;
        continue;
      }
      const Four& r = rows.d[PictureRows::kResidual];
      const Four variance = pixel + ground * rows.ground * rows.ground;
      const Four squares = r * r;
      const Four loss = levels_only ? one : one / (one + squares * bound / variance);
      products.add(rows, rows.asked & (loss / variance));
      pass.crossed += count_of(rows.crossed);
      const Four on_target = rows.asked & (rows.ground < cv::v_setall_f32(0.02F));
      const Four on_ground = rows.asked & (rows.ground > cv::v_setall_f32(0.8F));
      const Four weighted = loss * squares;
      pass.squares += sum_of(on_target, weighted);
      pass.weights += sum_of(on_target, loss);
      pass.bends += sum_of(on_target, loss * (loss + loss - one));
      pass.ground_squares += sum_of(on_ground, weighted);
      pass.ground_weights += sum_of(on_ground, loss);
      errs[0] = errs.back();
      cv::v_store(errs.data() + 1, on_target & (cv::v_sqrt(loss) * r));
      for (size_t k = 0; k < PictureRows::kPixels; ++k)
        pass.neighbours += static_cast<double>(errs[k]) * static_cast<double>(errs[k + 1]);
      // The lowest bit is the last pixel of those before.
      on_target_bits = on_target_bits >> PictureRows::kPixels | cv::v_signmask(on_target) << 1;
      pass.pairs += std::popcount(static_cast<unsigned>(on_target_bits & on_target_bits >> 1));
    }
  }
  products.take(pass.A, pass.b);
  return pass;
}

// The loss takes some of the noise for outliers: a fifth of what normal noise adds to the squares.
PictureFit::Noise PictureFit::noise_of(const Pass& pass) {
  Noise noise;
  constexpr double kTaken = 1.25, kRounding = 1.0 / 12;
  noise.pixel = std::max(kTaken * (pass.squares + 4) / (pass.weights + 4), kRounding);
  noise.ground =
      std::max(0.0, kTaken * pass.ground_squares / std::max(pass.ground_weights, 1.0) - noise.pixel);
  return noise;
}

// Weights are those of the residuals before the step, which another residual has others of: least squares
// with them go too short a way, by as much as the loss is less bent than its weights make it.
double PictureFit::lengthening(const Pass& pass) {
  constexpr double kMost = 1.5;
  return pass.bends * kMost > pass.weights ? pass.weights / pass.bends : kMost;
}

// How many of a pixel's neighbours err as it does, of noise none: what the model does not know (a shadow's
// edge, dirt) goes on from pixel to pixel. As of a process that forgets by the same part in each direction.
double PictureFit::together(const Pass& pass) {
  constexpr double kOfNoise = 0.05;  // correlations of a few thousand pixels that are nothing
  const double mean = pass.squares / std::max(pass.weights, 1.0);
  const double correlation = pass.neighbours / std::max(pass.pairs, 1.0) / std::max(mean, 1e-3);
  const double part = std::clamp(correlation - kOfNoise, 0.0, 0.9);
  return std::pow((1 + part) / (1 - part), 2);
}

std::optional<PictureFitted> PictureFit::fit(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane,
                                             double size, double blur_px, double contrast) {
  PictureFitted fitted;
  Eigen::Matrix3d H = image_from_plane;
  PictureParameters p;
  const double square = blur_px * blur_px;
  p.blur = square * Eigen::Matrix2d::Identity();
  Noise noise;
  Normal information;
  bool done = false;
  for (int round = 0; round < kMostPasses && !done; ++round) {
    fitted.frame = frame_of(H, Eigen::Vector2d::Zero(), size);
    is_outside_ = !model_.set(H, fitted.frame, p);
    if (is_outside_) return std::nullopt;
    // The first look finds the levels, in which the picture is linear: without any no edge moves it.
    const Pass pass = take(grey, noise, round == 0);
    information = pass.A;
    // What is known beforehand: a blur about that of the search, round; that white grows by a third of a
    // pixel at most, the outline otherwise by a third of that; levels that change by a fifth over the target.
    Normal known = Normal::Zero();
    Unknowns towards = Unknowns::Zero();
    const auto hold = [&](int i, double value, double expected, double sigma) {
      known(i, i) += 1 / (sigma * sigma);
      towards(i) += (expected - value) / (sigma * sigma);
    };
    hold(PictureRows::kBlur, 0.5 * p.blur.trace(), square, 0.6 * square);
    hold(PictureRows::kBlur + 1, 0.5 * (p.blur(0, 0) - p.blur(1, 1)), 0, 0.4 * square);
    hold(PictureRows::kBlur + 2, p.blur(0, 1), 0, 0.4 * square);
    hold(PictureRows::kGrowth, p.growth, 0, 0.3);
    hold(PictureRows::kGrowth + 1, p.outline_growth, 0, 0.0005 + 0.3 * std::abs(p.growth));
    for (const int i : {1, 2}) {
      hold(PictureRows::kWhite + i, p.white(i), 0, 25);
      hold(PictureRows::kGround + i, p.ground(i), 0, 25);
    }
    information += known;
    Normal held = information;
    constexpr double kSteepest = 3;  // as in fit_plane
    held(6, 6) += std::pow(kSteepest * fitted.frame.radius, -2);
    held(7, 7) += std::pow(kSteepest * fitted.frame.radius, -2);
    held.diagonal().array() += 1e-9 * held.diagonal().tail<7>().maxCoeff();
    const Unknowns x = lengthening(pass) * held.ldlt().solve(pass.b + towards);
    if (!x.allFinite()) return std::nullopt;
    p.white += x.segment<3>(PictureRows::kWhite);
    p.black += x(PictureRows::kBlack);
    p.ground += x.segment<3>(PictureRows::kGround);
    if (round == 0) continue;
    noise = noise_of(pass);
    noise.together = texture_together(0.5 * p.blur.trace());
    const PlaneStep step = x.head<8>();
    H = towards_camera(corrected(H, fitted.frame, step));
    const double mean = 0.5 * p.blur.trace() + x(8), most = 0.9 * std::max(mean, 0.1);
    const double along = 0.5 * (p.blur(0, 0) - p.blur(1, 1)) + x(9), diagonal = p.blur(0, 1) + x(10);
    const double stretch = std::hypot(along, diagonal), part = stretch > most ? most / stretch : 1;
    p.blur << std::max(mean, 0.1) + part * along, part * diagonal, part * diagonal,
        std::max(mean, 0.1) - part * along;
    p.growth = std::clamp(p.growth + x(PictureRows::kGrowth), -1.0, 1.0);
    p.outline_growth = std::clamp(p.outline_growth + x(PictureRows::kGrowth + 1), -0.5, 0.5);
    fitted.pixels = pass.crossed;
    fitted.together = together(pass);
    // Ends when the step is a tenth of its own deviation.
    done = round > 1 && step.dot(information.topLeftCorner<8, 8>() * step) < 0.1;
  }
  const double step = p.white.x() - p.black;
  // More of it, and the picture is not what the model says it is.
  constexpr double kMostTogether = 10;
  if (!done || !(step > contrast) || fitted.together > kMostTogether) return std::nullopt;
  constexpr int kRest = kUnknowns - 8;
  const Eigen::Matrix<double, 8, kRest> by_rest = information.topRightCorner<8, kRest>();
  const Eigen::Matrix<double, kRest, kRest> rest = information.bottomRightCorner<kRest, kRest>();
  fitted.information = information.topLeftCorner<8, 8>() - by_rest * rest.ldlt().solve(by_rest.transpose());
  fitted.information /= fitted.together;
  fitted.image_from_plane = H;
  fitted.frame = frame_of(H, Eigen::Vector2d::Zero(), size);
  fitted.growth = p.growth;
  fitted.rms_px = std::sqrt(noise.pixel) / step * 2.5 * blur_px;
  return fitted;
}

}  // namespace perch
