#include "perch/detection/grey_order.h"

#include <array>

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

std::optional<bool> GreyOrder::look(const cv::Mat& grey, const Eigen::Matrix3d& H, const Pair& pair,
                                    double contrast) const {
  const std::array<Eigen::Vector3d, 2> points{H * pair.white.homogeneous(), H * pair.black.homogeneous()};
  if (!(points[0].z() > 0 && points[1].z() > 0)) return std::nullopt;
  std::array<int, 2> values{};
  for (size_t i = 0; i < 2; ++i) {
    const auto pixel = camera_.pixel_from_camera(points[i]);
    if (!pixel ||
        !(pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < grey.cols - 1 && pixel->y() < grey.rows - 1)) {
      return std::nullopt;
    }
    values[i] = grey.at<uint8_t>(static_cast<int>(pixel->y() + 0.5), static_cast<int>(pixel->x() + 0.5));
  }
  return values[0] - values[1] >= contrast;
}

double GreyOrder::part_in_order(const cv::Mat& grey, const Eigen::Matrix3d& H, double contrast,
                                double least) const {
  int asked = 0, in_order = 0;
  // How many may be out of order if all are asked.
  const double allowed = (1 - least) * static_cast<double>(pairs_.size());
  for (const Pair& pair : pairs_) {
    const auto is_in_order = look(grey, H, pair, contrast);
    if (!is_in_order) continue;
    ++asked;
    in_order += *is_in_order;
    if (asked - in_order > allowed) return 0;
  }
  return asked < kLeastPairs ? 0 : static_cast<double>(in_order) / asked;
}

void GreyOrder::judge_edges(const cv::Mat& grey, const Eigen::Matrix3d& H, double contrast,
                            std::span<EdgeTally> tallies) const {
  for (const Pair& pair : pairs_) {
    const auto is_in_order = look(grey, H, pair, contrast);
    if (!is_in_order) continue;
    ++tallies[pair.edge].asked;
    tallies[pair.edge].found += *is_in_order;
  }
}

}  // namespace perch
