#include "calib/mount/navigation_noise.h"

#include <algorithm>
#include <cmath>

#include "perch/geometry/euler.h"

namespace perch {
namespace {

// Below these no navigation is worth its digits; they keep the weights finite.
constexpr double kLeastPosition = 2e-4;                 // m
constexpr double kLeastRotation = 0.005 * kRadFromDeg;  // rad
// Drift is what errors this far apart have in common: closer, they may be of the vehicle's motion between
// samples, and of the same samples.
constexpr double kShort = 0.3, kLong = 1.0;  // s

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct Part {
  double variance = 0;        // of the errors, vision's own taken off
  double drift_variance = 0;  // of what lasts
  double drift_time = 0;      // s
};

// How long the curve remembers a sample: as many steps as it averages samples.
double memory_of(const Trajectory& trajectory, double noise_part) { return trajectory.step() / noise_part; }

// Of position (first = 0) or rotation (first = 3); `memory` in s.
Part measure(const NoiseSamples& s, Eigen::Index first, double memory) {
  const double nearest = std::max(kShort, memory), unit = std::max(kLong, 3 * nearest);
  std::vector<double> sizes, camera;
  for (size_t i = 0; i < s.errors.size(); ++i) {
    for (Eigen::Index k = first; k < first + 3; ++k) {
      sizes.push_back(std::abs(s.errors[i][k]));
      camera.push_back(s.camera_variance[i][k]);
    }
  }
  const double n = static_cast<double>(sizes.size());
  // The median of what is not clearly wrong: with a third of wrong poses that of all is 1.7 times too large.
  double deviation = 1.4826 * median(sizes);
  for (int i = 0; i < 4; ++i) {
    std::vector<double> inside;
    for (const double size : sizes) {
      if (size < 4 * deviation) inside.push_back(size);
    }
    if (!inside.empty()) deviation = 1.4826 * median(inside);
  }
  Part part;
  // 13 unknowns were fitted to twice as many numbers.
  const double all = deviation * deviation * 2 * n / std::max(n, 2 * n - 13);
  part.variance = std::max(0.0, all - median(camera));

  const double limit = 4 * deviation;
  const auto product = [&](size_t i, size_t j, double* sum, int* count) {
    for (Eigen::Index k = first; k < first + 3; ++k) {
      const double a = s.errors[i][k], b = s.errors[j][k];
      if (std::abs(a) > limit || std::abs(b) > limit) continue;
      *sum += a * b;
      ++*count;
    }
  };
  constexpr int kBins = 8;  // mostly 0.3, 1, 2, 4, ... 128 s
  double sums[kBins] = {};
  int counts[kBins] = {};
  const size_t step = std::max<size_t>(1, s.times.size() / 1500);
  for (size_t i = 0; i < s.times.size(); i += step) {
    for (size_t j = i + 1; j < s.times.size(); j += step) {
      const double lag = s.times[j] - s.times[i];
      if (lag < nearest) continue;
      const int bin = lag < unit ? 0 : 1 + static_cast<int>(std::log2(lag / unit));
      if (bin < kBins) product(i, j, &sums[bin], &counts[bin]);
    }
  }
  if (counts[0] < 60) return part;
  const double lasting = sums[0] / counts[0];
  const double span = s.times.back() - s.times.front();
  // What chance makes of errors that forget themselves within that.
  const double independent = 3 * std::min(n / 3, span / std::max(0.25, memory));
  if (lasting < 0.15 * all || lasting < 3 * all / std::sqrt(independent)) return part;
  part.drift_variance = lasting;
  part.drift_time = span / 2;
  for (int bin = 1; bin < kBins; ++bin) {
    if (counts[bin] == 0) break;
    if (sums[bin] / counts[bin] > lasting / M_E) continue;
    part.drift_time = std::max(0.5, unit * std::pow(2, bin - 1));
    break;
  }
  return part;
}

// White noise of a sample and drift from what was measured.
void split(const Part& part, double sample_noise, double noise_part, double least, double* white,
           double* drift) {
  const double lasting = part.drift_variance;
  if (sample_noise > 0) {
    *white = std::max(sample_noise, least);
    // What the samples' noise does not explain and chance does not make: fast, but not the samples' own.
    const double rest = part.variance - lasting - sample_noise * sample_noise * noise_part;
    *drift = std::sqrt(lasting + (rest > 0.5 * part.variance ? rest : 0));
  } else {
    *white = std::max(std::sqrt(std::max(0.0, part.variance - lasting) / noise_part), least);
    *drift = std::sqrt(lasting);
  }
}

void keep_given(double given, double* value) {
  if (std::isfinite(given)) *value = given;
}

}  // namespace

NavigationNoise first_noise(const NavigationNoise& given, const Trajectory& trajectory, double start_misfit) {
  NavigationNoise noise;
  noise.position = std::max(trajectory.position_noise(), 0.03 * std::max(0.3, start_misfit));
  noise.rotation = std::max(trajectory.rotation_noise(), 0.6 * kRadFromDeg * std::max(0.3, start_misfit));
  noise.position_drift = noise.rotation_drift = 0;
  noise.drift_time = 10;
  keep_given(given.position, &noise.position);
  keep_given(given.rotation, &noise.rotation);
  keep_given(given.position_drift, &noise.position_drift);
  keep_given(given.rotation_drift, &noise.rotation_drift);
  keep_given(given.drift_time, &noise.drift_time);
  return noise;
}

NavigationNoise measured_noise(const NavigationNoise& given, const Trajectory& trajectory,
                               const NoiseSamples& samples) {
  Vector6d part = Vector6d::Zero();
  for (const Vector6d& p : samples.noise_part) part += p / static_cast<double>(samples.noise_part.size());
  if (samples.noise_part.empty()) part.setOnes();
  const Part position = measure(samples, 0, memory_of(trajectory, part[0])),
             rotation = measure(samples, 3, memory_of(trajectory, part[3]));
  NavigationNoise noise;
  split(position, trajectory.position_noise(), part[0], kLeastPosition, &noise.position,
        &noise.position_drift);
  split(rotation, trajectory.rotation_noise(), part[3], kLeastRotation, &noise.rotation,
        &noise.rotation_drift);
  noise.drift_time = std::max(position.drift_time, rotation.drift_time);
  if (noise.drift_time <= 0) noise.drift_time = 0.2;  // what is left over has no memory worth the name
  keep_given(given.position, &noise.position);
  keep_given(given.rotation, &noise.rotation);
  keep_given(given.position_drift, &noise.position_drift);
  keep_given(given.rotation_drift, &noise.rotation_drift);
  keep_given(given.drift_time, &noise.drift_time);
  return noise;
}

}  // namespace perch
