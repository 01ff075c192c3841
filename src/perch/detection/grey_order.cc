#include "perch/detection/grey_order.h"

#include <cmath>
#include <optional>

namespace perch {
namespace {

// Fewer pairs prove nothing.
constexpr int kLeastPairs = 8;

}  // namespace

GreyOrder::GreyOrder(const TargetEdges& target, const CameraModel& camera) : camera_(camera) {
  for (size_t i = 0; i < target.edges.size(); ++i) {
    const TargetEdge& edge = target.edges[i];
    const ShapeKind kind = target.shapes[static_cast<size_t>(edge.shape)].kind;
    // The ground beside the outline may be of any grey.
    if (kind == ShapeKind::kOutline) continue;
    const int count = kind == ShapeKind::kInterior ? 3 : 1;
    for (int k = 0; k < count; ++k) {
      const Eigen::Vector2d q = edge.from + (k + 0.5) / count * (edge.to - edge.from);
      pairs_.push_back({q + 0.5 * edge.white_room * edge.normal, q - 0.5 * edge.black_room * edge.normal, i});
    }
  }
}

double GreyOrder::part_in_order(const cv::Mat& grey, const Eigen::Matrix3d& H, double contrast) const {
  return part_in_order(grey, H, contrast, {});
}

double GreyOrder::part_in_order(const cv::Mat& grey, const Eigen::Matrix3d& H, double contrast,
                                std::span<EdgeTally> tallies) const {
  const auto value = [&](const Eigen::Vector2d& q) -> std::optional<int> {
    const Eigen::Vector3d p = H * q.homogeneous();
    const auto pixel = p.z() > 0 ? camera_.pixel_from_camera(p) : std::nullopt;
    if (!pixel ||
        !(pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < grey.cols - 1 && pixel->y() < grey.rows - 1)) {
      return std::nullopt;
    }
    return grey.at<uint8_t>(static_cast<int>(pixel->y() + 0.5), static_cast<int>(pixel->x() + 0.5));
  };
  int asked = 0, in_order = 0;
  for (const Pair& pair : pairs_) {
    const auto white = value(pair.white);
    const auto black = white ? value(pair.black) : std::nullopt;
    if (!black) continue;
    const bool is_in_order = *white - *black >= contrast;
    ++asked;
    in_order += is_in_order;
    if (tallies.empty()) continue;
    ++tallies[pair.edge].asked;
    tallies[pair.edge].found += is_in_order;
  }
  return asked < kLeastPairs ? 0 : static_cast<double>(in_order) / asked;
}

}  // namespace perch
