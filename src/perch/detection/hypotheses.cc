#include "perch/detection/hypotheses.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "perch/geometry/homography.h"

namespace perch {
namespace {

// Squares smaller than this are known by their centres better than by their corners.
constexpr double kByCorners = 9;  // px

std::optional<Eigen::Vector2d> ideal(const CameraModel& camera, const Eigen::Vector2d& pixel) {
  const auto ray = camera.ray_from_pixel(pixel);
  if (!ray || !(ray->z() > 0)) return std::nullopt;
  return ray->hnormalized();
}

// The affine map that fits best: far away the perspective drowns in the noise.
std::optional<Eigen::Matrix3d> affine_from_points(std::span<const Eigen::Vector2d> from,
                                                  std::span<const Eigen::Vector2d> to) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> b = Eigen::Matrix<double, 3, 2>::Zero();
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d q = from[i].homogeneous();
    A += q * q.transpose();
    b += q * to[i].transpose();
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(A);
  if (!lu.isInvertible()) return std::nullopt;
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
  H.topRows<2>() = lu.solve(b).transpose();
  return H;
}

Eigen::Matrix3d similarity(const Eigen::Vector2d& centre, double side, int quarter_turns) {
  const double c = quarter_turns % 2 == 0 ? 1 - quarter_turns : 0;
  const double s = quarter_turns % 2 == 0 ? 0 : 2 - quarter_turns;
  Eigen::Matrix3d T;
  T << c * side, -s * side, centre.x(), s * side, c * side, centre.y(), 0, 0, 1;
  return T;
}

}  // namespace

Hypotheses::Hypotheses(const LandingTarget& target, const TargetEdges& edges)
    : labelling_(Labelling::of(std::get<SquaresLayout>(target.layout))) {
  scales_.resize(std::get<SquaresLayout>(target.layout).nested ? 2 : 1);
  for (const TargetShape& shape : edges.shapes) {
    if (shape.kind == ShapeKind::kSquare) scales_[shape.inner ? 1 : 0].push_back({shape.centre, shape.side});
  }
}

// Fits the homography to every square of the layout that has a region where it should be.
std::optional<Hypothesis> Hypotheses::refined(std::span<const WhiteQuad> quads, int scale,
                                              const Eigen::Matrix3d& first, const CameraModel& camera) {
  Eigen::Matrix3d H = first;
  Hypothesis hypothesis;
  for (int round = 0; round < 2; ++round) {
    const double tolerance = round == 0 ? 0.45 : 0.3;  // of a square's side
    plane_.clear();
    image_.clear();
    hypothesis.squares = 0;
    for (const LayoutSquare& square : scales_[static_cast<size_t>(scale)]) {
      std::array<Eigen::Vector2d, 5> expected;  // corners, centre; px
      bool visible = true;
      const Quad corners =
          square_corners(square.centre - Eigen::Vector2d::Constant(square.side / 2), square.side);
      for (size_t k = 0; k < 5 && visible; ++k) {
        const Eigen::Vector3d p = H * (k < 4 ? corners[k] : square.centre).homogeneous();
        const auto pixel = p.z() > 0 ? camera.pixel_from_camera(p) : std::nullopt;
        visible = pixel.has_value();
        if (pixel) expected[k] = *pixel;
      }
      if (!visible) continue;
      const double diagonals =
          std::sqrt((expected[0] - expected[2]).norm() * (expected[1] - expected[3]).norm() / 2);
      const Eigen::Vector2d a = expected[0] - expected[2], b = expected[1] - expected[3];
      const double side = std::sqrt(std::abs(a.x() * b.y() - a.y() * b.x()) / 2);
      const WhiteQuad* nearest = nullptr;
      double distance = tolerance * diagonals + 1;
      for (const size_t i : near_) {
        const double d = (quads[i].seen.centre - expected[4]).norm();
        if (d < distance && quads[i].side_px < 1.8 * side + 2 && quads[i].side_px > 0.5 * side - 1.5) {
          distance = d;
          nearest = &quads[i];
        }
      }
      if (!nearest) continue;
      ++hypothesis.squares;
      const auto centre = ideal(camera, nearest->seen.centre);
      if (!centre) continue;
      plane_.push_back(square.centre);
      image_.push_back(*centre);
      if (!nearest->four_sided || nearest->side_px < kByCorners) continue;
      // The seen corners in the order that comes nearest to the expected ones.
      size_t turn = 0;
      double least = std::numeric_limits<double>::infinity();
      for (size_t t = 0; t < 4; ++t) {
        double sum = 0;
        for (size_t k = 0; k < 4; ++k)
          sum += (nearest->seen.corners[(k + t) % 4] - expected[k]).squaredNorm();
        if (sum < least) {
          least = sum;
          turn = t;
        }
      }
      for (size_t k = 0; k < 4; ++k) {
        const auto corner = ideal(camera, nearest->seen.corners[(k + turn) % 4]);
        if (!corner) continue;
        plane_.push_back(corners[k]);
        image_.push_back(*corner);
      }
    }
    // Eight corners do, but not two centres.
    if (hypothesis.squares < 3 && plane_.size() < 10) return std::nullopt;
    const bool corners_seen = plane_.size() > static_cast<size_t>(hypothesis.squares);
    const auto fitted =
        corners_seen ? homography_from_points(plane_, image_) : affine_from_points(plane_, image_);
    if (!fitted) return std::nullopt;
    H = (*fitted)(2, 2) < 0 ? Eigen::Matrix3d(-*fitted) : *fitted;
  }
  hypothesis.image_from_plane = H;
  return hypothesis;
}

void Hypotheses::of_seed(std::span<const WhiteQuad> quads, size_t seed, const CameraModel& camera,
                         std::vector<Hypothesis>& hypotheses) {
  hypotheses.clear();
  const WhiteQuad& quad = quads[seed];
  near_.clear();
  for (size_t i = 0; i < quads.size(); ++i) {
    const double distance = (quads[i].seen.centre - quad.seen.centre).norm();
    if (quads[i].around == quad.around && distance < 14 * quad.side_px) near_.push_back(i);
  }
  if (near_.size() < 2) return;
  const Quad unit = square_corners({-0.5, -0.5}, 1);
  std::array<Eigen::Vector2d, 4> image;
  for (size_t k = 0; k < 4; ++k) {
    const auto corner = ideal(camera, quad.seen.corners[k]);
    if (!corner) return;
    image[k] = *corner;
  }
  auto from_unit = homography_from_points(unit, image);
  if (!from_unit) return;
  if ((*from_unit)(2, 2) < 0) *from_unit = -*from_unit;
  for (int scale = 0; scale < static_cast<int>(scales_.size()); ++scale) {
    for (const LayoutSquare& square : scales_[static_cast<size_t>(scale)]) {
      for (int turns = 0; turns < 4; ++turns) {
        const Eigen::Matrix3d H = *from_unit * similarity(square.centre, square.side, turns).inverse();
        if (const auto better = refined(quads, scale, H, camera)) hypotheses.push_back(*better);
      }
    }
  }
  std::stable_sort(hypotheses.begin(), hypotheses.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.squares > b.squares; });
  if (hypotheses.size() > 6) hypotheses.resize(6);
}

void Hypotheses::of_group(std::span<const WhiteQuad> quads, std::span<const size_t> members,
                          const CameraModel& camera, std::vector<Hypothesis>& hypotheses) {
  hypotheses.clear();
  if (!labelling_) return;
  seen_.clear();
  near_.assign(members.begin(), members.end());
  for (const size_t i : members) {
    seen_.push_back(quads[i].seen);
    seen_.back().component = static_cast<int>(i);
  }
  if (!labelling_->label(seen_, labelled_)) return;
  // All corners, or where they are too small the centres alone.
  double smallest = quads[members[0]].side_px;
  for (const size_t i : members) smallest = std::min(smallest, quads[i].side_px);
  const bool by_corners = smallest >= kByCorners;
  image_.clear();
  for (const SeenSquare& square : labelled_) {
    for (size_t k = 0; k < (by_corners ? 4 : 1); ++k) {
      const auto point = ideal(camera, by_corners ? square.corners[k] : square.centre);
      if (!point) return;
      image_.push_back(*point);
    }
  }
  for (const auto& squares : scales_) {
    plane_.clear();
    for (const LayoutSquare& square : squares) {
      const Quad corners =
          square_corners(square.centre - Eigen::Vector2d::Constant(square.side / 2), square.side);
      for (size_t k = 0; k < (by_corners ? 4 : 1); ++k)
        plane_.push_back(by_corners ? corners[k] : square.centre);
    }
    const auto H = by_corners ? homography_from_points(plane_, image_) : affine_from_points(plane_, image_);
    if (H) hypotheses.push_back({*H, static_cast<int>(squares.size())});
  }
}

}  // namespace perch
