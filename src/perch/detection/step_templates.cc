#include "perch/detection/step_templates.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace perch {
namespace {

constexpr double kSmallestBlur = 0.45, kBlurRatio = 1.12;
constexpr int kBlurs = 18;  // up to 3.1 px
constexpr double kReaches[] = {kLeastReach, 1.9, 2.2, 2.6, 3, 3.5, 4, 4.6, 5.2, 6, kLargestReach};

double gauss(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI); }
double gauss_integral(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

}  // namespace

StepTemplates::StepTemplates(double sigma, double reach) : reach_(reach), templates_(kPhases + 1) {
  for (int k = 0; k <= kPhases; ++k) {
    Template& a = templates_[static_cast<size_t>(k)];
    a = {};
    const double phase = static_cast<double>(k) / kPhases - 0.5;
    for (int i = 0; i < kPixels; ++i) {
      const double x = i - kPixels / 2 - phase;
      if (std::abs(x) > reach) continue;
      const double step = gauss_integral(x / sigma) - 0.5, slope = gauss(x / sigma) / sigma;
      a.inside[i] = -1;
      a.step[i] = static_cast<int16_t>(std::lround(kOne * step));
      a.slope[i] = static_cast<int16_t>(std::lround(kOne * slope));
      const double narrower = x * slope;
      a.narrower[i] = static_cast<int16_t>(std::lround(kOne * narrower));
      const auto add = [&a](int sum, double product) { a.sums[sum] += static_cast<float>(product); };
      add(kN, 1);
      add(kT, step);
      add(kG, slope);
      add(kTT, step * step);
      add(kTG, step * slope);
      add(kGG, slope * slope);
      add(kW, narrower);
      add(kTW, step * narrower);
      add(kGW, slope * narrower);
      add(kWW, narrower * narrower);
      add(kXT, x * step);
    }
  }
}

StepTemplateTable::StepTemplateTable() {
  double sigma = kSmallestBlur;
  for (int i = 0; i < kBlurs; ++i, sigma *= kBlurRatio) {
    for (const double reach : kReaches) templates_.emplace_back(sigma, reach);
    sigmas_.push_back(sigma);
  }
}

const StepTemplateTable& StepTemplateTable::instance() {
  static const StepTemplateTable table;
  return table;
}

const StepTemplates& StepTemplateTable::of(double reach, double* sigma) const {
  // The nearest in their logarithms.
  static const double half_step = std::sqrt(kBlurRatio);
  size_t blur = 0;
  while (blur + 1 < sigmas_.size() && *sigma > half_step * sigmas_[blur]) ++blur;
  *sigma = sigmas_[blur];
  int r = 0;
  for (int k = 1; k < static_cast<int>(std::size(kReaches)); ++k) {
    if (reach >= kReaches[k]) r = k;
  }
  return templates_[blur * std::size(kReaches) + static_cast<size_t>(r)];
}

}  // namespace perch
