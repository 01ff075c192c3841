#include "perch/detection/hypotheses.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "perch/detection/confirm.h"
#include "perch/detection/edge_piece.h"
#include "perch/geometry/homography.h"

namespace perch {
namespace {

// Squares smaller than this are known by their centres better than by their corners.
constexpr double kByCorners = 9;  // px

// The perspective of a smaller one drowns in the noise of its corners.
constexpr double kByPerspective = 16;  // px

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

// From the plane to a unit square about the origin that is a square of the layout, turned by quarters.
Eigen::Matrix3d unit_from_plane(const Eigen::Vector2d& centre, double side, int quarter_turns) {
  const double c = (quarter_turns % 2 == 0 ? 1 - quarter_turns : 0) / side;
  const double s = (quarter_turns % 2 == 0 ? 0 : 2 - quarter_turns) / side;
  Eigen::Matrix3d T;
  T << c, s, -c * centre.x() - s * centre.y(), -s, c, s * centre.x() - c * centre.y(), 0, 0, 1;
  return T;
}

// From the unit square about the origin to the four corners of a region.
std::optional<Eigen::Matrix3d> from_unit_square(const std::array<Eigen::Vector2d, 4>& corners,
                                                bool perspective) {
  if (perspective) {
    const auto H = homography_from_points(square_corners({-0.5, -0.5}, 1), corners);
    return H ? std::optional(towards_camera(*H)) : std::nullopt;
  }
  const auto& [upper_right, upper_left, lower_left, lower_right] = corners;
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
  H.col(0).head<2>() = 0.5 * (upper_right - upper_left + lower_right - lower_left);
  H.col(1).head<2>() = 0.5 * (upper_right - lower_right + upper_left - lower_left);
  H.col(2).head<2>() = 0.25 * (upper_right + upper_left + lower_left + lower_right);
  return H;
}

}  // namespace

Hypotheses::Hypotheses(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera)
    : camera_(camera),
      px_(1 / camera.intrinsics()[0]),
      size_(target.size),
      labelling_(Labelling::of(std::get<SquaresLayout>(target.layout))) {
  scales_.resize(std::get<SquaresLayout>(target.layout).nested ? 2 : 1);
  for (const TargetShape& shape : edges.shapes) {
    if (shape.kind == ShapeKind::kSquare) scales_[shape.inner ? 1 : 0].push_back({shape.centre, shape.side});
  }
}

void Hypotheses::begin(std::span<const WhiteQuad> quads) {
  quads_ = quads;
  marks_.assign(quads.size(), {});
}

// Made when it is first asked for: most regions are never looked at.
const Hypotheses::Mark* Hypotheses::mark(size_t quad) {
  Mark& m = marks_[quad];
  if (m.tried) return m.seen ? &m : nullptr;
  m.tried = true;
  const auto ideal = [&](const Eigen::Vector2d& pixel, Eigen::Vector2d& point) {
    const auto ray = camera_.ray_from_pixel(pixel);
    if (!ray || !(ray->z() > 0)) return false;
    point = ray->hnormalized();
    return true;
  };
  m.seen = ideal(quads_[quad].seen.centre, m.centre);
  for (size_t k = 0; k < 4 && m.seen && quads_[quad].four_sided; ++k)
    m.seen = ideal(quads_[quad].seen.corners[k], m.corners[k]);
  return m.seen ? &m : nullptr;
}

void Hypotheses::begin_group(std::span<const size_t> members) {
  by_x_.clear();
  for (const size_t i : members) {
    if (mark(i)) by_x_.push_back(i);
  }
  std::ranges::sort(by_x_, {}, [this](size_t i) { return marks_[i].centre.x(); });
}

// The nearest to a place of those near whose sides are within bounds.
std::optional<size_t> Hypotheses::nearest_to(const Eigen::Vector2d& place, double reach,
                                             const SideBounds& side) const {
  std::optional<size_t> found;
  double nearest = reach * reach;
  for (auto it = std::ranges::lower_bound(near_, place.x() - reach, {}, &Near::x);
       it != near_.end() && it->x < place.x() + reach; ++it) {
    const double distance = (Eigen::Vector2d(it->x, it->y) - place).squaredNorm();
    if (distance < nearest && it->side_px < side.high && it->side_px > side.low) {
      nearest = distance;
      found = it->quad;
    }
  }
  return found;
}

// The nearest region about where each square of the layout should be, if it is of about its size.
void Hypotheses::match(int scale, const Eigen::Matrix3d& H, double tolerance) {
  matches_.clear();
  for (const LayoutSquare& square : scales_[static_cast<size_t>(scale)]) {
    const Eigen::Vector3d p = H * square.centre.homogeneous();
    if (!(p.z() > 0)) continue;
    const Eigen::Vector2d centre = p.hnormalized();
    const Eigen::Matrix2d by_q = (H.topLeftCorner<2, 2>() - centre * H.row(2).head<2>()) / p.z();
    const double side_px = std::sqrt(std::abs(by_q.determinant())) * square.side / px_;
    const double reach = tolerance * std::sqrt(by_q.col(0).norm() * by_q.col(1).norm()) * square.side + px_;
    const auto nearest = nearest_to(centre, reach, {0.5 * side_px - 1.5, 1.8 * side_px + 2});
    if (nearest) matches_.push_back({&square, *nearest});
  }
}

bool Hypotheses::has_corners(const Match& match) const {
  return quads_[match.quad].four_sided && quads_[match.quad].side_px >= kByCorners;
}

// Three squares, or two with eight corners.
bool Hypotheses::is_enough() const {
  return matches_.size() >= 3 || (matches_.size() == 2 && std::ranges::all_of(matches_, [&](const Match& m) {
                                    return has_corners(m);
                                  }));
}

// Five centres, or eight corners.
bool Hypotheses::is_firm(std::span<const Match> matches) const {
  return matches.size() >= 5 ||
         std::ranges::count_if(matches, [&](const Match& m) { return has_corners(m); }) >= 2;
}

// Those that the picture's edge cuts last; how many it does not.
size_t Hypotheses::sort_cut() {
  const auto cut = std::ranges::partition(matches_, [&](const Match& m) { return !quads_[m.quad].cut; });
  return matches_.size() - cut.size();
}

// The homography that fits best to the matched squares.
std::optional<Eigen::Matrix3d> Hypotheses::fitted(const Eigen::Matrix3d& H) {
  plane_.clear();
  image_.clear();
  // What is seen of one that is cut has another centre and other corners: it counts where the others alone
  // leave the perspective open.
  std::span<const Match> used(matches_.data(), sort_cut());
  if (!is_firm(used)) used = matches_;
  for (const auto& [square, quad] : used) {
    const Mark& m = marks_[quad];
    plane_.push_back(square->centre);
    image_.push_back(m.centre);
    if (!quads_[quad].four_sided || quads_[quad].side_px < kByCorners) continue;
    const Quad corners =
        square_corners(square->centre - Eigen::Vector2d::Constant(square->side / 2), square->side);
    // The seen corners in the order that comes nearest to the expected ones.
    size_t turn = 0;
    double least = std::numeric_limits<double>::infinity();
    std::array<Eigen::Vector2d, 4> expected;
    for (size_t k = 0; k < 4; ++k) expected[k] = (H * corners[k].homogeneous()).hnormalized();
    for (size_t t = 0; t < 4; ++t) {
      double sum = 0;
      for (size_t k = 0; k < 4; ++k) sum += (m.corners[(k + t) % 4] - expected[k]).squaredNorm();
      if (sum < least) {
        least = sum;
        turn = t;
      }
    }
    for (size_t k = 0; k < 4; ++k) {
      plane_.push_back(corners[k]);
      image_.push_back(m.corners[(k + turn) % 4]);
    }
  }
  const bool corners_seen = plane_.size() > used.size();
  return corners_seen ? homography_from_points(plane_, image_) : by_centres();
}

// Of few small squares: the affine map, and as much of a perspective as the centres ask for against what is
// possible at all.
std::optional<Eigen::Matrix3d> Hypotheses::by_centres() {
  auto H = affine_from_points(plane_, image_);
  if (!H || plane_.size() < 5) return H;
  const ImageFrame frame = frame_of(*H, Eigen::Vector2d::Zero(), size_);
  offsets_.clear();
  for (size_t i = 0; i < plane_.size(); ++i) {
    const Eigen::Vector2d at = (*H * plane_[i].homogeneous()).hnormalized();
    for (int axis = 0; axis < 2; ++axis) {
      EdgeOffset offset;
      const Eigen::Vector2d gradient = Eigen::Vector2d::Unit(axis) / px_;
      offset.jacobian = step_jacobian(at, gradient, frame);
      offset.offset = gradient.dot(image_[i] - at);
      offset.sigma = 0.3;  // px, of the centre of a small region
      offsets_.push_back(offset);
    }
  }
  return corrected(*H, frame, fit_plane(offsets_, frame, 0.3, 1).step);
}

// Fits the homography to every square of the layout that has a region where it should be.
std::optional<Hypothesis> Hypotheses::refined(int scale, const Eigen::Matrix3d& first) {
  Eigen::Matrix3d H = first;
  for (const double tolerance : {0.45, 0.3}) {  // of a square's side
    match(scale, H, tolerance);
    if (!is_enough()) return std::nullopt;
    const auto better = fitted(H);
    if (!better) return std::nullopt;
    H = towards_camera(*better);
  }
  return Hypothesis{H, static_cast<int>(matches_.size())};
}

void Hypotheses::of_seed(size_t seed, std::vector<Hypothesis>& hypotheses) {
  hypotheses.clear();
  const WhiteQuad& quad = quads_[seed];
  const Mark* own = mark(seed);
  if (!own || !quad.four_sided) return;
  near_.clear();
  // At 75 degrees a square looks half as large as it is long, and the farthest ones of the paper's layout are
  // six sides of a small one apart; the largest is 2.5 times as large as the smallest.
  for (const size_t i : by_x_) {
    const double distance = (quads_[i].seen.centre - quad.seen.centre).squaredNorm();
    const double side = quads_[i].side_px;
    if (distance < std::pow(14 * quad.side_px, 2) && side < 4 * quad.side_px + 2 &&
        4 * side > quad.side_px - 2) {
      near_.push_back({marks_[i].centre.x(), marks_[i].centre.y(), side, i});
    }
  }
  if (near_.size() < 2) return;
  const auto from_unit = from_unit_square(own->corners, quad.side_px >= kByPerspective);
  if (!from_unit) return;
  for (int scale = 0; scale < static_cast<int>(scales_.size()); ++scale) {
    for (const LayoutSquare& square : scales_[static_cast<size_t>(scale)]) {
      for (int turns = 0; turns < 4; ++turns) {
        const Eigen::Matrix3d H = *from_unit * unit_from_plane(square.centre, square.side, turns);
        if (!(H(2, 2) > 0)) continue;
        if (const auto better = refined(scale, H)) hypotheses.push_back(*better);
      }
    }
  }
  std::ranges::sort(hypotheses,
                    [](const Hypothesis& a, const Hypothesis& b) { return a.squares > b.squares; });
  if (hypotheses.size() > 6) hypotheses.resize(6);
}

void Hypotheses::of_group(std::span<const size_t> members, std::vector<Hypothesis>& hypotheses) {
  hypotheses.clear();
  if (!labelling_) return;
  seen_.clear();
  for (const size_t i : members) {
    if (!mark(i)) return;
    seen_.push_back(quads_[i].seen);
    seen_.back().component = static_cast<int>(i);
  }
  if (!labelling_->label(seen_, labelled_)) return;
  // All corners, or where they are too small the centres alone.
  double smallest = quads_[members[0]].side_px;
  for (const size_t i : members) smallest = std::min(smallest, quads_[i].side_px);
  const bool by_corners = smallest >= kByCorners;
  image_.clear();
  for (const SeenSquare& square : labelled_) {
    const Mark& m = marks_[static_cast<size_t>(square.component)];
    if (!by_corners) {
      image_.push_back(m.centre);
      continue;
    }
    // In the labels' order, which is that of the pixels.
    const auto& own = quads_[static_cast<size_t>(square.component)].seen.corners;
    for (const Eigen::Vector2d& corner : square.corners) {
      const auto k = static_cast<size_t>(std::ranges::find(own, corner) - own.begin());
      if (k == 4) return;
      image_.push_back(m.corners[k]);
    }
  }
  for (const auto& squares : scales_) {
    plane_.clear();
    for (const LayoutSquare& square : squares) {
      if (!by_corners) {
        plane_.push_back(square.centre);
        continue;
      }
      const Quad corners =
          square_corners(square.centre - Eigen::Vector2d::Constant(square.side / 2), square.side);
      plane_.insert(plane_.end(), corners.begin(), corners.end());
    }
    const auto H = by_corners ? homography_from_points(plane_, image_) : by_centres();
    if (H) hypotheses.push_back({towards_camera(*H), static_cast<int>(squares.size())});
  }
}

}  // namespace perch
