#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace perch {

enum class Response { kLinear, kSrgb };

struct SensorOptions {
  double exposure = 1;       // full wells that radiance 1 fills: paper of 0.8 then gives grey 204
  double full_well = 10000;  // e-, at grey 255
  double read_noise = 7;     // e-, one deviation
  Response response = Response::kLinear;
};

// Turns light into a picture: electrons n = full_well * exposure * L with variance n + read_noise^2 (shot
// noise is Poisson; above some tens of electrons that is normal), clipped at the full well, through the
// response, rounded to 8 bits. A linear grey level g then has the variance
//
//   var g = (255 / full_well)^2 (n + read_noise^2) + 1/12.
class Sensor {
 public:
  explicit Sensor(const SensorOptions& options = {});

  // Equal radiance, seed and frame give equal bytes.
  cv::Mat_<uint8_t> picture(const cv::Mat_<float>& radiance, uint64_t seed, uint64_t frame = 0) const;

  // The grey level without noise and rounding, for each pixel.
  cv::Mat_<float> expected_grey(const cv::Mat_<float>& radiance) const;

 private:
  uint8_t grey(double filled) const;

  SensorOptions options_;
  std::vector<uint8_t> table_;  // grey of the full well's 65536ths
};

// The response curve: grey in 0 .. 1 of the filled part of the well, 0 .. 1.
double response_curve(Response response, double filled);

}  // namespace perch
