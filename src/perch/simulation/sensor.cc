#include "perch/simulation/sensor.h"

#include <algorithm>
#include <cmath>

#include "perch/simulation/random.h"

namespace perch {

namespace {
constexpr int kTable = 65536;  // steep sRGB darks then still have 20 entries a grey level
}

double response_curve(Response response, double filled) {
  const double x = std::clamp(filled, 0.0, 1.0);
  if (response == Response::kLinear) return x;
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

Sensor::Sensor(const SensorOptions& options) : options_(options), table_(kTable + 1) {
  for (int i = 0; i <= kTable; ++i) {
    const double x = response_curve(options.response, static_cast<double>(i) / kTable);
    table_[static_cast<size_t>(i)] = static_cast<uint8_t>(std::lround(255 * x));
  }
}

uint8_t Sensor::grey(double filled) const {
  return table_[static_cast<size_t>(std::clamp(filled, 0.0, 1.0) * kTable + 0.5)];
}

cv::Mat_<uint8_t> Sensor::picture(const cv::Mat_<float>& radiance, uint64_t seed, uint64_t frame) const {
  RandomStream random(seed, frame);
  cv::Mat_<uint8_t> picture(radiance.size());
  const double read_variance = options_.read_noise * options_.read_noise;
  for (int v = 0; v < radiance.rows; ++v) {
    const float* light = radiance[v];
    uint8_t* out = picture[v];
    for (int u = 0; u < radiance.cols; ++u) {
      const double electrons = options_.full_well * options_.exposure * static_cast<double>(light[u]);
      const double deviation = std::sqrt(std::max(electrons, 0.0) + read_variance);
      out[u] = grey((electrons + deviation * random.normal()) / options_.full_well);
    }
  }
  return picture;
}

cv::Mat_<float> Sensor::expected_grey(const cv::Mat_<float>& radiance) const {
  cv::Mat_<float> expected(radiance.size());
  std::transform(radiance.begin(), radiance.end(), expected.begin(), [&](float light) {
    return static_cast<float>(
        255 * response_curve(options_.response, options_.exposure * static_cast<double>(light)));
  });
  return expected;
}

}  // namespace perch
