#include "perch/detection/level_surface.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// Of a plane, and as many again that show whether it is one; of a curved surface.
constexpr size_t kLeastOfPlane = 8, kLeastOfCurved = 24;

// No light is more even than this: paper, ink and the sensor's rows.
constexpr double kLeastSpread = 0.2;  // grey levels

// A fit whose spread changes by no more than this part of it has found its weights.
constexpr double kSettled = 0.05;

// A shadow is looked for where the levels are more uneven than this, and believed where it explains so much
// that this part of the variance is left: any two levels would explain two thirds.
constexpr double kUneven = 0.7;  // grey levels
constexpr double kClearer = 0.2;
constexpr double kFaintest = 0.85;  // of the light left: less of a shadow than this is dirt
constexpr size_t kLeastOfSide = 3;  // in the light, and in the shadow

// What is off the surface differs from place to place over so many px.
constexpr double kPatch = 20;

}  // namespace

LevelSurface::Coefficients LevelSurface::row_at(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d u = (pixel - origin_) / reach_;
  Coefficients row;
  row << 1, u.x(), u.y(), u.x() * u.x(), u.x() * u.y(), u.y() * u.y();
  return row;
}

LevelSurface::Fitted LevelSurface::evenly_lit(std::span<const LevelSample> samples, int unknowns) const {
  Fitted fitted;
  // Cauchy's loss about what the round before left; the first takes all alike.
  double spread = 1e3;
  Eigen::Matrix<double, 6, 6> A;
  for (int round = 0; round < 4; ++round) {
    A.setZero();
    // What is not asked for stays zero.
    A.diagonal().tail(6 - unknowns).setOnes();
    Coefficients b = Coefficients::Zero();
    for (size_t i = 0; i < samples.size(); ++i) {
      const Coefficients& row = rows_[i];
      const LevelSample& s = samples[i];
      const double r = s.value - row.dot(fitted.x), scale = spread + s.variance;
      const double weight = round == 0 ? 1 / scale : 1 / (scale + 0.25 * r * r);
      const Coefficients weighted = weight * row;
      A.noalias() += weighted * row.transpose();
      b += s.value * weighted;
    }
    A.diagonal() += Coefficients::Constant(1e-9 * A.trace());
    fitted.x = A.ldlt().solve(b);
    if (!fitted.x.allFinite()) return {};
    double sum = 0, count = 0;
    for (size_t i = 0; i < samples.size(); ++i) {
      const double variance = samples[i].variance, r = samples[i].value - rows_[i].dot(fitted.x);
      const double weight = round == 0 ? 1 : 1 / (1 + 0.25 * r * r / (spread + variance));
      sum += weight * (r * r - variance);
      count += weight;
    }
    const double before = spread;
    spread = std::max(sum / std::max(count - unknowns, 1.0), kLeastSpread * kLeastSpread);
    if (round > 0 && std::abs(spread - before) < kSettled * before) break;
  }
  fitted.covariance = A.inverse();
  fitted.covariance.bottomRightCorner(6 - unknowns, 6 - unknowns).setZero();
  fitted.variance = spread;
  return fitted;
}

// Two levels, of which one is a part of the other everywhere: first the two that split all values best, then
// by Gauss and Newton with each sample on the side that it is nearer to. Those between, in the shadow's soft
// edge, are outliers to both.
std::optional<LevelSurface::Fitted> LevelSurface::shaded(std::span<const LevelSample> samples, int unknowns) {
  sorted_.clear();
  for (const LevelSample& s : samples) sorted_.push_back(s.value);
  std::ranges::sort(sorted_);
  const auto n = static_cast<double>(sorted_.size());
  double total = 0, below = 0, best = 0;
  for (const double value : sorted_) total += value;
  Fitted fitted;
  for (size_t i = 0; i + 1 < sorted_.size(); ++i) {
    below += sorted_[i];
    const double count = static_cast<double>(i) + 1, low = below / count,
                 high = (total - below) / (n - count);
    const double between = count * (n - count) * (high - low) * (high - low);
    if (between > best && high > 0) {
      best = between;
      fitted.x(0) = high;
      fitted.shade = low / high;
    }
  }
  double spread = std::pow(0.25 * fitted.x(0) * (1 - fitted.shade), 2);
  Eigen::Matrix<double, 7, 7> A;
  for (int round = 0; round < 6; ++round) {
    A.setZero();
    A.diagonal().segment(unknowns, 6 - unknowns).setOnes();
    Eigen::Matrix<double, 7, 1> b = Eigen::Matrix<double, 7, 1>::Zero();
    double sum = 0, weights = 0;
    size_t in_shade = 0;
    for (size_t i = 0; i < samples.size(); ++i) {
      const double lit = rows_[i].dot(fitted.x), value = samples[i].value;
      const bool is_shaded = std::abs(value - fitted.shade * lit) < std::abs(value - lit);
      Eigen::Matrix<double, 7, 1> row;
      row << (is_shaded ? fitted.shade : 1) * rows_[i], is_shaded ? lit : 0;
      const double r = value - (is_shaded ? fitted.shade : 1) * lit, scale = spread + samples[i].variance;
      const double weight = 1 / (scale + 0.25 * r * r);
      A.noalias() += weight * row * row.transpose();
      b += weight * r * row;
      sum += weight * scale * (r * r - samples[i].variance);
      weights += weight * scale;
      in_shade += is_shaded;
    }
    if (in_shade < kLeastOfSide || samples.size() - in_shade < kLeastOfSide) return {};
    A.diagonal().array() += 1e-9 * A.diagonal().head<6>().sum();
    const Eigen::Matrix<double, 7, 1> step = A.ldlt().solve(b);
    if (!step.allFinite()) return {};
    fitted.x += step.head<6>();
    fitted.shade += step(6);
    spread = std::max(sum / std::max(weights - unknowns - 1, 1.0), kLeastSpread * kLeastSpread);
  }
  if (!(fitted.shade > 0 && fitted.shade < kFaintest)) return {};
  fitted.covariance = A.inverse().topLeftCorner<6, 6>();
  fitted.covariance.bottomRightCorner(6 - unknowns, 6 - unknowns).setZero();
  fitted.variance = spread;
  return fitted;
}

void LevelSurface::fit(std::span<const LevelSample> samples) {
  fitted_ = {};
  if (samples.size() < kLeastOfPlane) return;
  origin_.setZero();
  for (const LevelSample& s : samples) origin_ += s.pixel / static_cast<double>(samples.size());
  reach_ = 1;
  for (const LevelSample& s : samples) reach_ = std::max(reach_, (s.pixel - origin_).norm());
  const int unknowns = samples.size() < kLeastOfCurved ? 3 : 6;
  rows_.clear();
  for (const LevelSample& s : samples) {
    rows_.push_back(row_at(s.pixel));
    rows_.back().tail(6 - unknowns).setZero();
  }
  fitted_ = evenly_lit(samples, unknowns);
  if (fitted_.variance < kUneven * kUneven || samples.size() < 2 * kLeastOfPlane) return;
  const auto with_shadow = shaded(samples, unknowns);
  if (with_shadow && with_shadow->variance < kClearer * fitted_.variance) fitted_ = *with_shadow;
}

LevelSurface::Level LevelSurface::at(const Eigen::Vector2d& pixel, double own) const {
  Coefficients row = row_at(pixel);
  const double u = row(1), v = row(2);
  const Coefficients& x = fitted_.x;
  const double lit = row.dot(x);
  const double shade = std::abs(own - fitted_.shade * lit) < std::abs(own - lit) ? fitted_.shade : 1;
  const Eigen::Vector2d slope(x(1) + 2 * x(3) * u + x(4) * v, x(2) + x(4) * u + 2 * x(5) * v);
  return {shade * lit, fitted_.variance + row.dot(fitted_.covariance * row), shade / reach_ * slope,
          std::sqrt(fitted_.variance) / kPatch};
}

}  // namespace perch
