#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace perch {

// What a list of errors comes to, in the unit of its values. All NaN when there are none.
struct Statistics {
  size_t count = 0;
  double rms = std::numeric_limits<double>::quiet_NaN();
  // The DC offset that the paper's calc_dc_offset.m removes: what a calibration error leaves.
  double mean = std::numeric_limits<double>::quiet_NaN();
  double rms_without_mean = std::numeric_limits<double>::quiet_NaN();  // what noise leaves
  // Of the absolute values.
  double median = std::numeric_limits<double>::quiet_NaN();
  double p95 = std::numeric_limits<double>::quiet_NaN();
  double p99 = std::numeric_limits<double>::quiet_NaN();
  double max = std::numeric_limits<double>::quiet_NaN();
};

// `values` must be finite.
Statistics statistics(std::span<const double> values);

// The same of differences of angles, rad: 2 pi more or less changes nothing, and differences that scatter
// about pi have a mean near pi, not near 0.
Statistics angle_statistics(std::span<const double> differences);

// The 95 % interval of the RMS of values of which those of one cluster (a second, say) err alike: the mean
// square's scatter from cluster to cluster, of its logarithm, by Student's t. NaN of fewer than three
// clusters.
struct RmsInterval {
  double low = std::numeric_limits<double>::quiet_NaN(), high = std::numeric_limits<double>::quiet_NaN();
};
RmsInterval rms_interval(std::span<const double> values, std::span<const int64_t> clusters);

// The value below which a fraction of the values lies, linear between two of them; NaN of none.
double quantile(std::vector<double> values, double fraction);

// The x with P(chi^2 <= x) = probability, 0 < probability < 1, for an even number of degrees of freedom above
// 0.
double chi_square_quantile(double probability, int degrees_of_freedom);

}  // namespace perch
