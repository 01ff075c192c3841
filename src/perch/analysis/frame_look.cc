#include "perch/analysis/frame_look.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace perch {
namespace {

// Places a side: 20 hit every square of a target of 20 modules.
constexpr int kPlaces = 20;

bool is_inside(const Quad& corners, const Eigen::Vector2d& p) {
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d edge = corners[(i + 1) % 4] - corners[i], to = p - corners[i];
    if (edge.x() * to.y() - edge.y() * to.x() < 0) return false;
  }
  return true;
}

// Whether the target is white there; empty beside it.
std::optional<bool> colour_at(const LandingTarget& target, const Eigen::Vector2d& p) {
  for (auto patch = target.patches.rbegin(); patch != target.patches.rend(); ++patch) {
    if (is_inside(patch->corners, p)) return patch->white;
  }
  return std::nullopt;
}

double median(std::vector<double>& values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

GreyHistogram grey_histogram(const cv::Mat& grey) {
  GreyHistogram histogram;
  std::array<uint32_t, GreyHistogram::kBins> counts{};
  uint32_t all = 0;
  for (int y = 0; y < grey.rows; y += 4) {
    const uint8_t* row = grey.ptr<uint8_t>(y);
    for (int x = 0; x < grey.cols; x += 4, ++all) ++counts[row[x] / (256 / GreyHistogram::kBins)];
  }
  if (all == 0) return histogram;
  for (size_t i = 0; i < counts.size(); ++i) {
    histogram.share[i] = static_cast<uint16_t>(std::lround(65535.0 * counts[i] / all));
  }
  return histogram;
}

TargetViewer::TargetViewer(const LandingTarget& target) {
  const Bounds bounds = printed_bounds(target);
  const Eigen::Vector2d step = (bounds.upper_right - bounds.lower_left) / kPlaces;
  for (int i = 0; i < kPlaces * kPlaces; ++i) {
    const Eigen::Vector2d p =
        bounds.lower_left + step.cwiseProduct(Eigen::Vector2d(i % kPlaces + 0.5, i / kPlaces + 0.5));
    const auto colour = colour_at(target, p);
    bool is_plain = colour.has_value();
    for (const Eigen::Vector2d& side : {Eigen::Vector2d(1, 1), Eigen::Vector2d(1, -1)}) {
      for (const double sign : {-0.45, 0.45})
        is_plain = is_plain && colour_at(target, p + sign * step.cwiseProduct(side)) == colour;
    }
    if (is_plain) places_.push_back({{p.x(), p.y(), 0}, *colour});
  }
}

TargetLook TargetViewer::look(const cv::Mat& grey, const CameraModel& camera,
                              const Rigid3& camera_from_target) const {
  std::vector<std::pair<double, bool>> seen;  // grey level, whether it should be white
  std::vector<double> white, black;
  for (const Place& place : places_) {
    const auto pixel = camera.pixel_from_camera(camera_from_target * place.p_target);
    if (!pixel) continue;
    const double x = std::round(pixel->x()), y = std::round(pixel->y());
    if (!(x >= 0 && y >= 0 && x < grey.cols && y < grey.rows)) continue;
    const double level = grey.at<uint8_t>(static_cast<int>(y), static_cast<int>(x));
    seen.emplace_back(level, place.white);
    (place.white ? white : black).push_back(level);
  }
  TargetLook look;
  look.white = median(white);
  look.black = median(black);
  if (!seen.empty() && (white.empty() || black.empty())) {  // of one colour alone nobody knows which it is
    look.visible = std::numeric_limits<double>::quiet_NaN();
    return look;
  }
  const double middle = (look.white + look.black) / 2;
  size_t right = 0;
  for (const auto& [level, is_white] : seen) right += (level > middle) == is_white;
  if (!places_.empty()) look.visible = static_cast<double>(right) / static_cast<double>(places_.size());
  return look;
}

}  // namespace perch
