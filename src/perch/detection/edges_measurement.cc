#include "perch/detection/edges_measurement.h"

#include <algorithm>
#include <cmath>

#include "perch/detection/confirm.h"

namespace perch {
namespace {

// A piece of an edge for the fine fit: an arc over this length is a parabola to a hundredth of a pixel.
constexpr double kPiece = 32;  // px

// A first look at the edges is the last where it moves none of them by more than this, finds the blur that
// was expected, to a part of it, and at least this part of the pieces of the target's own edges.
constexpr double kStill = 0.3;  // px
constexpr double kMostPieces = 0.9;
constexpr int kMostLooks = 3;

// How far a fit to a blurred step is off one bent by the sensor's response differs by its reach: by this part
// of the growth.
constexpr double kBent = 0.1;

// No lens is sharper, its pixels included; what seems to be is drawn without a lens.
constexpr double kSharpest = 0.45;  // px

// By what the sigmas of so many offsets are to be multiplied, whose scatter about the fit is `scale` sigmas.
// Where they scatter less, as the noise of the dark is not that of an edge's middle, the fit has taken a part
// of the scatter, and a few tell it roughly.
double spread_of(double scale, size_t offsets) {
  constexpr double kFitted = 9, kBelieved = 30;
  if (scale >= 1) return scale;
  const auto n = static_cast<double>(offsets);
  return std::min(1.0, std::sqrt((n * scale * scale + kBelieved) / (n + kBelieved - kFitted)));
}

}  // namespace

// How much of the growth each edge has. The outline's step is from a ground of any grey: what a response that
// is not linear does to it is less by its smaller modulation, from a dark ground to a pale one by the power
// 1.25 of it for sRGB; what light spread in the lens does is not.
void EdgesMeasurement::share_growth() {
  const auto by_ground = [&](size_t i) { return on_ground_[static_cast<size_t>(measured_[i])] != 0; };
  double sum = 0, count = 0;
  for (size_t i = 0; i < offsets_.size(); ++i) {
    if (by_ground(i)) continue;
    sum += offsets_[i].modulation;
    count += 1;
  }
  for (size_t i = 0; i < offsets_.size(); ++i) {
    if (!by_ground(i)) continue;
    const double part = std::min(offsets_[i].modulation * count / std::max(sum, 1e-9), 1.0);
    offsets_[i].white = -std::pow(part, 1.25);
    offsets_[i].outline = -1;
  }
}

const TargetShape& EdgesMeasurement::shape_of(const EdgePiece& piece) const {
  return edges_.shapes[static_cast<size_t>(edges_.edges[static_cast<size_t>(piece.edge)].shape)];
}

// Whether the whole target is: both ends of each of its own edges.
bool EdgesMeasurement::is_all_in_view() const {
  const auto is_seen = [&](const Eigen::Vector2d& pixel) {
    return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera_.width() - 1 &&
           pixel.y() <= camera_.height() - 1;
  };
  std::ptrdiff_t ends = 0;
  for (const EdgePiece& piece : pieces_) {
    if (shape_of(piece).is_on_ground()) continue;
    ends += piece.first && is_seen(piece.begin);
    ends += piece.last && is_seen(piece.end);
  }
  const auto grounds = std::ranges::count_if(edges_.shapes, &TargetShape::is_on_ground);
  return ends == 2 * (std::ssize(edges_.edges) - 4 * grounds);
}

// Those of a nested target that is still too small for it are not asked for. False where the hole's are among
// them, which alone tell the outer target from the inner one.
bool EdgesMeasurement::drop_narrow_pieces(double blur_px) {
  const auto is_hole = [&](const EdgePiece& piece) { return shape_of(piece).kind == ShapeKind::kHole; };
  const auto holes = std::ranges::count_if(pieces_, is_hole);
  std::erase_if(pieces_, [&](const EdgePiece& piece) {
    return shape_of(piece).inner && !EdgeFit::has_room(piece, blur_px);
  });
  return std::ranges::count_if(pieces_, is_hole) == holes;
}

// Of the target's own edges: the ground beside its outline may be as pale.
bool EdgesMeasurement::is_most_measured() const {
  const auto own = static_cast<double>(std::ranges::count(on_ground_, 0));
  const auto found =
      std::ranges::count_if(measured_, [&](int i) { return on_ground_[static_cast<size_t>(i)] == 0; });
  return static_cast<double>(found) >= kMostPieces * own;
}

std::optional<PlaneMeasurement> EdgesMeasurement::measure(const cv::Mat& grey,
                                                          const Eigen::Matrix3d& image_from_plane,
                                                          double blur_px, bool must_confirm,
                                                          std::vector<EdgeResidual>& residuals) {
  PlaneMeasurement plane;
  Eigen::Matrix3d H = image_from_plane;
  PlaneFit fit;
  EdgeFitOptions how{options_.lines_per_edge, blur_px, options_.min_contrast};
  double bent = 0;
  const auto fit_widened = [&](double by) {
    for (EdgeOffset& o : offsets_) o.sigma = std::hypot(o.sigma, by);
    fit = fit_plane(offsets_, plane.frame, 0.3, 3);
  };
  bool is_settled = false;
  for (int look = 1; !is_settled && look <= kMostLooks; ++look) {
    plane.frame = frame_of(H, Eigen::Vector2d::Zero(), size_);
    project_edges(edges_, H, camera_, kPiece, pieces_);
    if (must_confirm && !is_all_in_view()) return std::nullopt;
    if (!drop_narrow_pieces(how.blur) && must_confirm) return std::nullopt;
    on_ground_.clear();
    for (const EdgePiece& piece : pieces_) on_ground_.push_back(shape_of(piece).is_on_ground());
    how.least_measured = must_confirm ? kMostPieces : 0;
    edge_fit_.measure(grey, pieces_, on_ground_, plane.frame, how, offsets_, measured_);
    if (offsets_.size() < 10) return std::nullopt;
    share_growth();
    fit_widened(std::hypot(options_.systematic_px, bent));
    const double now_bent = kBent * std::abs(fit.growth);
    if (now_bent > bent + options_.systematic_px) fit_widened(std::sqrt(now_bent * now_bent - bent * bent));
    bent = now_bent;
    H = towards_camera(corrected(H, plane.frame, fit.step));
    const double blur = std::max(std::sqrt(0.5 * edge_fit_.blur().trace()), kSharpest);
    const bool is_most = is_most_measured();
    if (must_confirm && !is_most) return std::nullopt;
    const bool as_expected = std::abs(blur - how.blur) < kSameBlur * blur && is_most;
    const double moved = fit.step.norm() * plane.frame.radius * camera_.intrinsics()[0];
    is_settled = moved < kStill && (look > 1 || as_expected);
    // What goes on moving is no target.
    if (look == kMostLooks && moved > 0.5 * blur) return std::nullopt;
    how.blur = blur;
  }
  plane.frame = frame_of(H, Eigen::Vector2d::Zero(), size_);
  plane.image_from_plane = H;
  const double spread = spread_of(fit.scale, offsets_.size());
  plane.information = fit.information / (spread * spread);
  double weights = 0;
  for (const EdgeOffset& o : offsets_) weights += o.weight / (o.sigma * o.sigma);
  plane.sigma_px = std::sqrt(static_cast<double>(offsets_.size()) / weights) * spread;
  plane.rms_px = fit.rms_px;
  plane.growth_px = fit.growth;
  plane.blur_px = how.blur;
  plane.edges = static_cast<int>(offsets_.size());
  for (size_t i = 0; i < offsets_.size(); ++i) {
    const EdgePiece& piece = pieces_[static_cast<size_t>(measured_[i])];
    residuals.push_back(
        {piece.middle.cast<float>(), piece.normal.cast<float>(), static_cast<float>(offsets_[i].left)});
  }
  return plane;
}

}  // namespace perch
