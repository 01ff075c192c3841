#include "perch/detection/picture_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

#include "perch/detection/confirm.h"
#include "perch/detection/edge_blur.h"

namespace perch {
namespace {

constexpr int kUnknowns = PictureRow::kUnknowns, kColumns = PictureRow::kColumns;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

// Cauchy's loss in deviations: 95 % efficient on Gaussian noise.
constexpr double kCauchy = 2.4;

constexpr int kMostPasses = 8;

// Sums of products of rows, the residual's column with them; four columns at a time, the upper blocks only.
class Products {
 public:
  Products() {
    for (auto& of_row : sum_) {
      for (auto& four : of_row) four = cv::v_setzero_f32();
    }
  }
  void add(const PictureRow& row, float weight) {
    cv::v_float32x4 block[kBlocks];
    for (int k = 0; k < kBlocks; ++k) block[k] = cv::v_load(row.d.data() + 4 * k);
    // A flat pixel has nothing to say of the step, blur and growth.
    for (int i = row.flat ? 12 : 0; i < kUnknowns; ++i) {
      const float own = row.d[static_cast<size_t>(i)];
      if (own == 0) continue;
      const cv::v_float32x4 w = cv::v_setall_f32(weight * own);
      for (int k = i / 4; k < kBlocks; ++k) sum_[i][k] += w * block[k];
    }
  }
  // Both are added to.
  void take(Normal& A, Unknowns& b) const {
    for (int i = 0; i < kUnknowns; ++i) {
      std::array<float, kColumns> row{};
      for (int k = i / 4; k < kBlocks; ++k) cv::v_store(row.data() + 4 * k, sum_[i][k]);
      for (int j = i; j < kUnknowns; ++j)
        A(i, j) = A(j, i) = static_cast<double>(row[static_cast<size_t>(j)]);
      b(i) = static_cast<double>(row[PictureRow::kResidual]);
    }
  }

 private:
  static constexpr int kBlocks = kColumns / 4;
  cv::v_float32x4 sum_[kUnknowns][kBlocks];
};

}  // namespace

// What one look at all pixels gives.
struct PictureFit::Pass {
  Normal A = Normal::Zero();
  Unknowns b = Unknowns::Zero();
  double squares = 0, weights = 0;                // of pixels without ground
  double ground_squares = 0, ground_weights = 0;  // of pixels that are ground
  double neighbours = 0, pairs = 0;               // products of one pixel's with the next one's
  int crossed = 0;
};

PictureFit::Pass PictureFit::take(const cv::Mat& grey, const Noise& noise, bool levels_only) {
  Pass pass;
  Products products;
  PictureRow row;
  // Every second row is enough for levels.
  for (int y = model_.first_row(); y <= model_.last_row(); y += levels_only ? 2 : 1) {
    const uint8_t* line = grey.ptr<uint8_t>(y);
    double last = 0;
    bool has_last = false;
    for (int x = model_.first_column(); x <= model_.last_column(); ++x) {
      if (!model_.row_of(x, y, line[x], row)) {
        has_last = false;
        continue;
      }
      const double r = static_cast<double>(row.d[PictureRow::kResidual]),
                   ground = static_cast<double>(row.ground);
      const double variance = noise.pixel + noise.together * noise.ground * ground * ground;
      const double loss = levels_only ? 1 : 1 / (1 + r * r / (kCauchy * kCauchy * variance));
      products.add(row, static_cast<float>(loss / variance));
      pass.crossed += !row.flat;
      const bool on_target = ground < 0.02;
      if (on_target && has_last) {
        pass.neighbours += last * std::sqrt(loss) * r;
        pass.pairs += 1;
      }
      last = std::sqrt(loss) * r;
      has_last = on_target;
      if (on_target) {
        pass.squares += loss * r * r;
        pass.weights += loss;
      } else if (ground > 0.8) {
        pass.ground_squares += loss * r * r;
        pass.ground_weights += loss;
      }
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
    if (!model_.set(H, fitted.frame, p)) return std::nullopt;
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
    hold(PictureRow::kBlur, 0.5 * p.blur.trace(), square, 0.6 * square);
    hold(PictureRow::kBlur + 1, 0.5 * (p.blur(0, 0) - p.blur(1, 1)), 0, 0.4 * square);
    hold(PictureRow::kBlur + 2, p.blur(0, 1), 0, 0.4 * square);
    hold(PictureRow::kGrowth, p.growth, 0, 0.3);
    hold(PictureRow::kGrowth + 1, p.outline_growth, 0, 0.0005 + 0.3 * std::abs(p.growth));
    for (const int i : {1, 2}) {
      hold(PictureRow::kWhite + i, p.white(i), 0, 25);
      hold(PictureRow::kGround + i, p.ground(i), 0, 25);
    }
    information += known;
    Normal held = information;
    constexpr double kSteepest = 3;  // as in fit_plane
    held(6, 6) += std::pow(kSteepest * fitted.frame.radius, -2);
    held(7, 7) += std::pow(kSteepest * fitted.frame.radius, -2);
    held.diagonal().array() += 1e-9 * held.diagonal().tail<7>().maxCoeff();
    const Unknowns x = held.ldlt().solve(pass.b + towards);
    if (!x.allFinite()) return std::nullopt;
    p.white += x.segment<3>(PictureRow::kWhite);
    p.black += x(PictureRow::kBlack);
    p.ground += x.segment<3>(PictureRow::kGround);
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
    p.growth = std::clamp(p.growth + x(PictureRow::kGrowth), -1.0, 1.0);
    p.outline_growth = std::clamp(p.outline_growth + x(PictureRow::kGrowth + 1), -0.5, 0.5);
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
