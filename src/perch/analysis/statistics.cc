#include "perch/analysis/statistics.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/euler.h"

namespace perch {
namespace {

double mean_of(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double rms_of(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

double sorted_quantile(std::span<const double> sorted, double fraction) {
  const double place = fraction * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

// Everything but the two numbers that need to know what a mean is.
Statistics statistics_about(std::span<const double> values, double mean, std::span<const double> deviations) {
  std::vector<double> sizes;
  sizes.reserve(values.size());
  for (const double value : values) sizes.push_back(std::abs(value));
  std::sort(sizes.begin(), sizes.end());
  return {.count = values.size(),
          .rms = rms_of(values),
          .mean = mean,
          .rms_without_mean = rms_of(deviations),
          .median = sorted_quantile(sizes, 0.5),
          .p95 = sorted_quantile(sizes, 0.95),
          .p99 = sorted_quantile(sizes, 0.99),
          .max = sizes.back()};
}

// P(chi^2 > x) with 2 m degrees of freedom is the Poisson sum e^-h (1 + h + ... + h^(m-1) / (m-1)!), h = x
// / 2.
double chi_square_survival(double x, int m) {
  const double h = x / 2;
  // From the last term down: 1 / (m-1)! alone would underflow.
  double term = std::exp((m - 1) * std::log(h) - h - std::lgamma(m));
  double sum = 0;
  for (int i = m - 1; i >= 0; --i) {
    sum += term;
    term *= i / h;
  }
  return sum;
}

}  // namespace

Statistics statistics(std::span<const double> values) {
  if (values.empty()) return {};
  const double mean = mean_of(values);
  std::vector<double> deviations;
  deviations.reserve(values.size());
  for (const double value : values) deviations.push_back(value - mean);
  return statistics_about(values, mean, deviations);
}

Statistics angle_statistics(std::span<const double> differences) {
  if (differences.empty()) return {};
  double sine = 0, cosine = 0;
  std::vector<double> wrapped;
  wrapped.reserve(differences.size());
  for (const double difference : differences) {
    wrapped.push_back(wrap_angle(difference));
    sine += std::sin(difference);
    cosine += std::cos(difference);
  }
  // The direction of the mean vector is biased by skewed scatter; it serves as the place to unwrap about
  // only.
  const double centre = std::atan2(sine, cosine);
  std::vector<double> deviations;
  deviations.reserve(differences.size());
  for (const double difference : differences) deviations.push_back(wrap_angle(difference - centre));
  const double correction = mean_of(deviations);
  for (double& deviation : deviations) deviation -= correction;
  return statistics_about(wrapped, wrap_angle(centre + correction), deviations);
}

double quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  return sorted_quantile(values, fraction);
}

double chi_square_quantile(double probability, int degrees_of_freedom) {
  const int m = degrees_of_freedom / 2;
  // Ten deviations hold every probability that a double tells from 0 and 1 by more than 1e-10.
  const double reach = 10 * std::sqrt(2.0 * degrees_of_freedom) + 50;
  double low = std::max(0.0, degrees_of_freedom - reach), high = degrees_of_freedom + reach;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (1 - chi_square_survival(middle, m) < probability ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace perch
