#include "perch/detection/tag_border.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "perch/geometry/homography.h"

namespace perch {
namespace {

// The grey level between pixels.
std::optional<double> level(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  const Eigen::Array2d corner = pixel.array().floor();
  if (!(corner.x() >= 0 && corner.y() >= 0 && corner.x() + 1 < grey.cols && corner.y() + 1 < grey.rows))
    return {};
  const uint8_t* upper = grey.ptr(static_cast<int>(corner.y())) + static_cast<ptrdiff_t>(corner.x());
  const uint8_t* lower = upper + grey.step[0];
  const Eigen::Array2d part = pixel.array() - corner;
  return (1 - part.y()) * ((1 - part.x()) * upper[0] + part.x() * upper[1]) +
         part.y() * ((1 - part.x()) * lower[0] + part.x() * lower[1]);
}

}  // namespace

double border_agreement(const cv::Mat& grey, const Eigen::Matrix3d& pixel_from_tag, int modules,
                        bool black_border) {
  const double half_module = 1.0 / modules;  // the edges are at -1 and 1
  const double sign = black_border ? 1 : -1;
  std::vector<double> contrasts;
  for (int side = 0; side < 4; ++side) {
    for (int i = 1; i < 2 * modules; ++i) {
      const double along = -1 + i * half_module;
      const auto at = [&](double across) {
        const Eigen::Vector2d turned[] = {
            {along, across}, {along, -across}, {across, along}, {-across, along}};
        return level(grey, apply(pixel_from_tag, turned[side]));
      };
      const auto inside = at(1 - half_module), outside = at(1 + half_module);
      if (inside && outside) contrasts.push_back(sign * (*outside - *inside) / (*outside + *inside + 1));
    }
  }
  if (contrasts.empty()) return 0;
  const auto middle = contrasts.begin() + static_cast<ptrdiff_t>(contrasts.size() / 2);
  std::nth_element(contrasts.begin(), middle, contrasts.end());
  const double enough = *middle / 2;
  if (!(enough > 0)) return 0;
  const auto clear = std::count_if(contrasts.begin(), contrasts.end(), [&](double c) { return c >= enough; });
  return static_cast<double>(clear) / static_cast<double>(contrasts.size());
}

}  // namespace perch
