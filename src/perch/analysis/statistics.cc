#include "perch/analysis/statistics.h"

#include <algorithm>
#include <cmath>
#include <map>

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

// Of 97.5 % by Cornish and Fisher's expansion: 3 % too small of two degrees of freedom, exact of many.
double student_t_quantile(double degrees_of_freedom) {
  constexpr double z = 1.959964;
  const double n = degrees_of_freedom, z2 = z * z;
  return z + z * (z2 + 1) / (4 * n) + z * ((5 * z2 + 16) * z2 + 3) / (96 * n * n) +
         z * (((3 * z2 + 19) * z2 + 17) * z2 - 15) / (384 * n * n * n);
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

RmsInterval rms_interval(std::span<const double> values, std::span<const int64_t> clusters) {
  struct Sum {
    double squares = 0, count = 0;
  };
  std::map<int64_t, Sum> sums;
  Sum all;
  for (size_t i = 0; i < values.size(); ++i) {
    const double square = values[i] * values[i];
    for (Sum* sum : {&sums[clusters[i]], &all}) {
      sum->squares += square;
      sum->count += 1;
    }
  }
  const auto n = static_cast<double>(sums.size());
  if (n < 3 || !(all.squares > 0)) return {};
  const double mean_square = all.squares / all.count;
  double scatter = 0;
  for (const auto& [cluster, sum] : sums) scatter += std::pow(sum.squares - sum.count * mean_square, 2);
  const double relative = std::sqrt(n / (n - 1) * scatter) / all.squares;
  // An RMS varies by half of what its square does.
  const double factor = std::exp(0.5 * student_t_quantile(n - 1) * relative);
  const double rms = std::sqrt(mean_square);
  return {rms / factor, rms * factor};
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
