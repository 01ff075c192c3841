#include "perch/detection/plane_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <span>

#include "perch/detection/sum_in_order.h"

namespace perch {
namespace {

// A step, the growth of white and what the outline grows otherwise.
using Unknowns = Eigen::Matrix<double, 10, 1>;
using Normal = Eigen::Matrix<double, 10, 10>;

Eigen::Matrix3d matrix_of(const PlaneStep& d) {
  Eigen::Matrix3d D;
  D << d(0), d(1), d(2), d(3), d(4), d(5), d(6), d(7), 0;
  return D;
}

// An offset as a row of the least squares, whitened: ten derivatives, the offset itself.
constexpr int kColumns = 11;
using Row = std::array<float, 12>;  // three times four, the last zero

Row row_of(const EdgeOffset& o) {
  Row row{};
  const auto per_sigma = static_cast<float>(1 / o.sigma);
  for (int i = 0; i < 8; ++i) row[static_cast<size_t>(i)] = per_sigma * static_cast<float>(o.jacobian(i));
  row[8] = per_sigma * static_cast<float>(o.white);
  row[9] = per_sigma * static_cast<float>(o.outline);
  row[10] = per_sigma * static_cast<float>(o.offset);
  return row;
}

using Four = cv::v_float32x4;

struct FourRows {
  Four sum[4][3];

  FourRows() {
    for (auto& row : sum) {
      for (Four& four : row) four = cv::v_setzero_f32();
    }
  }
  // A row's columns from the four of `kFirst` on times those four, which are weighted.
  template <int kFirst>
  void add(const Four& weighted, const Four (&row)[3]) {
    const Four each[4] = {cv::v_broadcast_element<0>(weighted), cv::v_broadcast_element<1>(weighted),
                          cv::v_broadcast_element<2>(weighted), cv::v_broadcast_element<3>(weighted)};
    for (int i = 0; i < 4; ++i) {
      for (int k = kFirst; k < 3; ++k) sum[i][k] += each[i] * row[k];
    }
  }
};

// The sum of the rows' weighted products with themselves, which is symmetric. In two turns: each has no more
// sums than a processor has registers.
Eigen::Matrix<double, kColumns, kColumns> products_of(std::span<const Row> rows,
                                                      std::span<const float> weights) {
  FourRows upper, middle, lower;
  const auto load = [&](size_t i, Four(&row)[3]) {
    for (int k = 0; k < 3; ++k) row[k] = cv::v_load(rows[i].data() + 4 * k);
    return cv::v_setall_f32(weights[i]);
  };
  Four row[3];
  for (size_t i = 0; i < rows.size(); ++i) {
    const Four weight = load(i, row);
    upper.add<0>(weight * row[0], row);
  }
  for (size_t i = 0; i < rows.size(); ++i) {
    const Four weight = load(i, row);
    middle.add<1>(weight * row[1], row);
    lower.add<2>(weight * row[2], row);
  }
  float sums[12][12] = {};
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 3; ++k) {
      cv::v_store(&sums[i][4 * k], upper.sum[i][k]);
      cv::v_store(&sums[4 + i][4 * k], middle.sum[i][k]);
      cv::v_store(&sums[8 + i][4 * k], lower.sum[i][k]);
    }
  }
  Eigen::Matrix<double, kColumns, kColumns> M;
  for (int i = 0; i < kColumns; ++i) {
    for (int j = i; j < kColumns; ++j) M(i, j) = M(j, i) = static_cast<double>(sums[i][j]);
  }
  return M;
}

float residual_of(const Row& row, const std::array<float, 12>& x) {
  const cv::v_float32x4 products = cv::v_load(row.data()) * cv::v_load(x.data()) +
                                   cv::v_load(row.data() + 4) * cv::v_load(x.data() + 4) +
                                   cv::v_load(row.data() + 8) * cv::v_load(x.data() + 8);
  return -sum_in_order(products);
}

// The median of |residual| as a standard deviation, to 3 %: from a histogram of their logarithms, which a
// float's upper bits are.
float robust_scale(const std::vector<float>& residuals) {
  constexpr int kShift = 18, kLowest = 127 - 10, kBins = 20 << 5;  // 32 to the octave, from 2^-10 to 2^10
  std::array<uint16_t, kBins> histogram{};
  std::array<uint16_t, kBins / 32> octaves{};
  for (const float r : residuals) {
    const int bin = static_cast<int>(std::bit_cast<uint32_t>(std::abs(r)) >> kShift) - (kLowest << 5);
    const auto clamped = static_cast<size_t>(std::clamp(bin, 0, kBins - 1));
    ++histogram[clamped];
    ++octaves[clamped / 32];
  }
  size_t below = 0, bin = 0;
  while (bin + 32 < kBins && 2 * (below + octaves[bin / 32]) < residuals.size()) {
    below += octaves[bin / 32];
    bin += 32;
  }
  while (bin + 1 < kBins && 2 * (below += histogram[bin]) < residuals.size()) ++bin;
  return 1.4826F * std::bit_cast<float>((static_cast<uint32_t>(bin) + (kLowest << 5)) << kShift);
}

}  // namespace

Eigen::Matrix3d corrected(const Eigen::Matrix3d& image_from_plane, const ImageFrame& frame,
                          const PlaneStep& step) {
  const Eigen::Matrix3d H = frame.to_image() * (Eigen::Matrix3d::Identity() + matrix_of(step)) *
                            frame.from_image() * image_from_plane;
  return H / H.norm();
}

PlaneStep step_between(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to, const ImageFrame& frame) {
  Eigen::Matrix3d D = frame.from_image() * to * from.inverse() * frame.to_image();
  D /= D(2, 2);
  D -= Eigen::Matrix3d::Identity();
  PlaneStep step;
  step << D(0, 0), D(0, 1), D(0, 2), D(1, 0), D(1, 1), D(1, 2), D(2, 0), D(2, 1);
  return step;
}

PlaneStep step_jacobian(const Eigen::Vector2d& image, const Eigen::Vector2d& gradient,
                        const ImageFrame& frame) {
  const Eigen::Vector2d u = (image - frame.centre) / frame.radius, g = frame.radius * gradient;
  PlaneStep row;
  const double along = -g.dot(u);
  row << g.x() * u.x(), g.x() * u.y(), g.x(), g.y() * u.x(), g.y() * u.y(), g.y(), along * u.x(),
      along * u.y();
  return row;
}

PlaneFit fit_plane(std::vector<EdgeOffset>& offsets, const ImageFrame& frame, double sigma_growth, int rounds,
                   double steepest) {
  // Kept from call to call for their memory.
  thread_local std::vector<Row> rows;
  thread_local std::vector<float> residuals, weights;
  PlaneFit fit;
  Unknowns x = Unknowns::Zero();
  Normal information = Normal::Zero();
  rows.clear();
  for (const EdgeOffset& o : offsets) rows.push_back(row_of(o));
  residuals.resize(rows.size());
  weights.assign(rows.size(), 1);
  std::array<float, 12> step{};
  step[10] = -1;
  float scale = 1;
  double sigma_outline = 0.3 * sigma_growth;
  const auto weigh = [&] {
    for (size_t i = 0; i < rows.size(); ++i) residuals[i] = residual_of(rows[i], step);
    scale = std::max(robust_scale(residuals), 0.3F);
  };
  for (int round = 0; round < rounds; ++round) {
    weigh();
    // Twice the scale: 95 % efficient on Gaussian noise, Cauchy's. The first round knows no better than that
    // all may be right, and doubts the far ones less.
    const float bound = 2.4F * scale;
    for (size_t i = 0; i < rows.size(); ++i) {
      const float r = std::abs(residuals[i]) / bound;
      weights[i] = 1 / (1 + (round == 0 ? r : r * r));
    }
    const auto M = products_of(rows, weights);
    information = M.topLeftCorner<10, 10>();
    Normal held = information;
    const double perspective = 1 / std::pow(steepest * frame.radius, 2);
    held(6, 6) += perspective;
    held(7, 7) += perspective;
    held(8, 8) += 1 / (sigma_growth * sigma_growth);
    // Where white does not grow at all, the outline does not either, to a hundredth.
    sigma_outline = 0.0005 + 0.3 * (round == 0 ? sigma_growth : std::abs(x(8)));
    held(9, 9) += 1 / (sigma_outline * sigma_outline);
    held.diagonal() += Unknowns::Constant(1e-9 * held.trace());
    const Eigen::LLT<Normal> llt(held);
    x = llt.solve(M.topRightCorner<10, 1>().eval());
    if (llt.info() != Eigen::Success || !x.allFinite()) {
      x.setZero();
      std::fill_n(step.begin(), 10, 0.0F);
      break;
    }
    for (int i = 0; i < 10; ++i) step[static_cast<size_t>(i)] = static_cast<float>(x(i));
  }
  weigh();
  fit.step = x.head<8>();
  fit.growth = x(8);
  fit.scale = static_cast<double>(scale);
  Eigen::Matrix2d of_growth = information.bottomRightCorner<2, 2>();
  of_growth(0, 0) += 1 / (sigma_growth * sigma_growth);
  of_growth(1, 1) += 1 / (sigma_outline * sigma_outline);
  const Eigen::Matrix<double, 8, 2> by_growth = information.topRightCorner<8, 2>();
  fit.information =
      information.topLeftCorner<8, 8>() - by_growth * of_growth.inverse() * by_growth.transpose();
  double squares = 0, sum = 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    const double r = offsets[i].sigma * static_cast<double>(residuals[i]);
    offsets[i].left = r;
    offsets[i].weight = static_cast<double>(weights[i]);
    squares += offsets[i].weight * r * r;
    sum += offsets[i].weight;
  }
  fit.rms_px = sum > 0 ? std::sqrt(squares / sum) : 0;
  return fit;
}

}  // namespace perch
