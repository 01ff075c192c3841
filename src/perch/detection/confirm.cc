#include "perch/detection/confirm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

namespace perch {
namespace {

// An edge whose neighbours are nearer than this cannot be told from them.
constexpr double kLeastRoom = 1.6;  // px

// Lines across an edge, of the search that counts; before, as few as will do to get there.
constexpr int kLastLines = 6;

// Nor does a target of which so little can be seen say what it is.
constexpr int kLeastLines = 12;

// Of the lines across a square or an edge: fewer, and it is hidden; more, and it is there.
constexpr double kHidden = 0.25, kThere = 0.8;
constexpr int kLeastOfEdge = 3;

// Of the lines of a first look that makes a second one needless.
constexpr double kPlain = 0.95;

// Found steps are where they should be, not only near, if they are not farther off than this.
constexpr double kInPlace = 0.8;  // px

// Squares smaller than this are measured by their picture.
constexpr double kSmallSquare = 7;  // px

// Of values, at least one, which it puts into another order.
double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The same of the steps' contrasts, which are whole numbers.
double median_contrast(std::span<const FoundStep> steps) {
  std::array<size_t, 256> counts{};
  for (const FoundStep& step : steps) ++counts[static_cast<size_t>(std::clamp(step.contrast, 0.0, 255.0))];
  size_t below = 0, level = 0;
  while (level < 255 && (below += counts[level]) <= steps.size() / 2) ++level;
  return static_cast<double>(level);
}

}  // namespace

ImageFrame frame_of(const Eigen::Matrix3d& H, const Eigen::Vector2d& centre, double size) {
  const Eigen::Vector3d p = H * centre.homogeneous();
  ImageFrame frame;
  frame.centre = p.hnormalized();
  const Eigen::Matrix2d by_q = (H.topLeftCorner<2, 2>() - frame.centre * H.row(2).head<2>()) / p.z();
  frame.radius = 0.5 * size * by_q.norm() / std::sqrt(2.0);
  return frame;
}

Confirmation::Confirmation(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera)
    : target_(edges),
      camera_(camera),
      grey_order_(edges, camera),
      size_(target.size),
      tallies_(edges.edges.size()) {
  smallest_.fill(target.size);
  for (const TargetShape& shape : edges.shapes) {
    double& smallest = smallest_[shape.inner];
    if (shape.kind == ShapeKind::kSquare) smallest = std::min(smallest, shape.side);
  }
}

bool Confirmation::has_small_squares(const ImageFrame& frame) const {
  return 2 * frame.radius * camera_.intrinsics()[0] * smallest_[0] < kSmallSquare * size_;
}

// Whether the last look shows the target as a whole, and nearly all of it where it should be.
bool Confirmation::is_plain(const ImageFrame& frame, int lines) const {
  if (has_small_squares(frame)) return false;
  const auto is_ground = [&](size_t edge) { return target_.shapes[edge / 4].is_on_ground(); };
  int asked = 0, found = 0;
  for (size_t i = 0; i < tallies_.size(); ++i) {
    if (is_ground(i)) continue;
    if (!target_.shapes[i / 4].inner && tallies_[i].asked < lines) return false;
    asked += tallies_[i].asked;
  }
  for (size_t i = 0; i < offsets_.size(); ++i)
    found += !is_ground(static_cast<size_t>(steps_[i].edge)) && std::abs(offsets_[i].left) < kInPlace;
  return found >= kPlain * asked;
}

bool Confirmation::is_met(const cv::Mat& grey, const Eigen::Matrix3d& H, const Requirement& requirement) {
  // Edges too short or too near each other to be told apart are judged by the grey beside them.
  const auto is_unsure = [](const EdgeTally& tally) { return tally.asked < 2; };
  in_order_.assign(tallies_.size(), {});
  if (std::ranges::any_of(tallies_, is_unsure)) {
    grey_order_.judge_edges(grey, H, requirement.contrast, in_order_);
  }
  // Of all edges that can be told: whether any is missing; whether two of each square's are there.
  bool is_faultless = true;
  partly_ = 0;
  int squares = 0, all_squares = 0, complete = 0, broken = 0, border_edges = 0;
  int holes = 0, holes_asked = 0, inner_squares = 0, asked = 0, found = 0;
  bool is_nested = false;
  for (size_t i = 0; i < target_.shapes.size(); ++i) {
    const ShapeKind kind = target_.shapes[i].kind;
    int known = 0, seen = 0, lines = 0, lines_found = 0;
    bool is_broken = false;
    for (size_t k = 4 * i; k < 4 * i + 4; ++k) {
      const EdgeTally& tally = tallies_[k];
      // The ground beside the outline may be as pale: nobody can ask for that.
      if (!target_.shapes[i].is_on_ground()) {
        found += tally.found;
        asked += tally.asked;
      }
      is_broken = is_broken || (tally.asked >= kLeastOfEdge && tally.found <= kHidden * tally.asked);
      lines += tally.asked;
      lines_found += tally.found;
      const EdgeTally& judged = is_unsure(tally) ? in_order_[k] : tally;
      if (judged.asked == 0) continue;
      ++known;
      if (5 * judged.found >= 3 * judged.asked) ++seen;
    }
    seen_[i] = seen >= 3 || (known == 2 && seen == 2);
    if (kind == ShapeKind::kSquare) {
      squares += seen_[i];
      complete += seen >= 2;
      broken += is_broken;
      inner_squares += target_.shapes[i].inner && seen_[i];
      partly_ += lines_found > kHidden * lines && lines_found < kThere * lines;
      ++all_squares;
    } else {
      border_edges += seen;
    }
    if (kind != ShapeKind::kOutline) is_faultless = is_faultless && seen == known;
    if (kind == ShapeKind::kHole) {
      is_nested = true;
      holes += seen;
      holes_asked += known;
    }
  }
  // Half of them may be covered. A homography that makes squares elsewhere nearly ours has edges missing of
  // more.
  if (2 * broken > all_squares) return false;
  // Without the hole it is the other one of the two targets.
  if (holes_asked >= 3 && 2 * holes < holes_asked) return false;
  // Nor is there anything to tell which it is where neither the hole nor what lies in it is seen, but the
  // frames before.
  const bool is_cold = requirement.squares > 1;
  if (is_nested && is_cold && holes == 0 && inner_squares < 2) return false;
  // So near that less of the border is in the picture, all squares are, or all but one and a side of it.
  const bool is_within =
      is_faultless && complete + std::min(border_edges, 1) >= all_squares && found >= kPlain * asked;
  const bool is_border_met = border_edges >= requirement.border_edges || is_within;
  own_ = asked > 0 ? static_cast<double>(found) / asked : 0;
  return squares >= requirement.squares && is_border_met && asked >= kLeastLines &&
         found >= requirement.found * asked;
}

// Whether edges mostly are wholly there or not at all: in noise that hides some, it hides parts of all.
bool Confirmation::is_clear() const {
  constexpr int kLeastAsked = 4, kLeastEdges = 12;
  constexpr double kClear = 0.8;
  int edges = 0, clear = 0;
  for (const EdgeTally& tally : tallies_) {
    if (tally.asked < kLeastAsked) continue;
    ++edges;
    clear += tally.found <= 1 || tally.found + 1 >= tally.asked;
  }
  return edges >= kLeastEdges && clear >= kClear * edges;
}

// Whether all lines across all four edges show them where they should be.
bool Confirmation::is_whole(size_t shape, int lines) const {
  return std::ranges::all_of(std::span(tallies_).subspan(4 * shape, 4), [&](const EdgeTally& tally) {
    return tally.asked >= lines && tally.found == tally.asked;
  });
}

// The pixel where a point of the plane is seen; empty where it is not in the picture.
std::optional<int> Confirmation::grey_at(const cv::Mat& grey, const Eigen::Matrix3d& H,
                                         const Eigen::Vector2d& point) const {
  const Eigen::Vector3d p = H * point.homogeneous();
  const auto pixel = p.z() > 0 ? camera_.pixel_from_camera(p) : std::nullopt;
  if (!pixel ||
      !(pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() <= grey.cols - 1 && pixel->y() <= grey.rows - 1)) {
    return std::nullopt;
  }
  return grey.at<uint8_t>(static_cast<int>(std::lround(pixel->y())),
                          static_cast<int>(std::lround(pixel->x())));
}

// Whether there is a white square beside the place of ours: white on both sides of one of its edges, black on
// both sides of another. Something pale that covers a part of it leaves none of the rest black, something
// black makes nothing white.
bool Confirmation::is_beside(const cv::Mat& grey, const Eigen::Matrix3d& H, const TargetShape& square,
                             double contrast) const {
  constexpr int kSides = 4, kPoints = 3;
  constexpr double kWhite = 0.7, kBlack = 0.2, kFull = 0.6;  // of the contrast
  const double half = 0.5 * square.side, off = 0.25 * smallest_[square.inner];
  std::array<std::array<std::optional<int>, 2 * kPoints>, kSides> seen;
  int low = 255, high = 0;
  for (size_t side = 0; side < kSides; ++side) {
    const Eigen::Vector2d out = side % 2 == 0 ? Eigen::Vector2d::UnitX() : Eigen::Vector2d::UnitY();
    const Eigen::Vector2d normal = side < 2 ? out : Eigen::Vector2d(-out), along(-normal.y(), normal.x());
    for (size_t k = 0; k < 2 * kPoints; ++k) {
      const double across = half + (k < kPoints ? -off : off);
      const double t = (static_cast<double>(k % kPoints) - 1) * (half - off);
      seen[side][k] = grey_at(grey, H, square.centre + across * normal + t * along);
      if (!seen[side][k]) continue;
      low = std::min(low, *seen[side][k]);
      high = std::max(high, *seen[side][k]);
    }
  }
  if (high - low < kFull * contrast) return false;
  bool white = false, black = false;
  for (const auto& side : seen) {
    int both_white = 0, both_black = 0;
    for (size_t k = 0; k < kPoints; ++k) {
      if (!side[k] || !side[k + kPoints]) continue;
      const auto [darker, brighter] = std::minmax({*side[k], *side[k + kPoints]});
      both_white += darker > low + kWhite * (high - low);
      both_black += brighter < low + kBlack * (high - low);
    }
    white = white || 2 * both_white > kPoints;
    black = black || 2 * both_black > kPoints;
  }
  return white && black;
}

// The brightest of nine pixels in the middle of a square's place, and the mean of eight around it, a quarter
// of its side off; of those that are in the picture. Empty where these are few.
std::optional<SquareLevels> Confirmation::levels_of(const cv::Mat& grey, const Eigen::Matrix3d& H,
                                                    const TargetShape& square) const {
  SquareLevels levels;
  std::array<double, 8> ring{};
  int inside = 0, around = 0;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      // Outside, a quarter of the side off: that is a quarter of the way to the next square of sharp.
      for (const double far : {0.3, 0.75}) {
        if (u == 0 && v == 0 && far > 0.5) continue;
        const Eigen::Vector2d q = square.centre + far * square.side * Eigen::Vector2d(u, v);
        const auto seen = grey_at(grey, H, q);
        if (!seen) continue;
        const double value = *seen;
        if (far < 0.5) {
          levels.inside = std::max(levels.inside, value);
          ++inside;
        } else {
          ring[static_cast<size_t>(around++)] = value;
        }
      }
    }
  }
  if (inside < 3 || around < 3) return std::nullopt;
  const std::span<const double> seen(ring.data(), static_cast<size_t>(around));
  levels.around = std::accumulate(seen.begin(), seen.end(), 0.0) / around;
  // Nearer to white than to black: glare lifts the black on one side.
  const double middle = 0.7 * levels.inside + 0.3 * *std::ranges::min_element(seen);
  levels.pale_around =
      static_cast<double>(std::ranges::count_if(seen, [&](double v) { return v > middle; })) / around;
  return levels;
}

// Whether most of the squares that were seen lie in black by themselves: those of a checkerboard touch
// others. And whether places of squares that were not seen are other than as black as the interior is in the
// brightest light that falls on it: what covers a square is rarely that. One such is forgiven if all others
// are seen.
bool Confirmation::is_layout(const cv::Mat& grey, const Eigen::Matrix3d& H) const {
  double black = 0, contrast = 255;
  int free = 0, touched = 0, seen = 0, unseen = 0, lacking = 0;
  const auto is_square = [&](size_t i) { return target_.shapes[i].kind == ShapeKind::kSquare; };
  for (size_t i = 0; i < target_.shapes.size(); ++i) {
    if (!is_square(i) || !seen_[i]) continue;
    ++seen;
    const auto levels = levels_of(grey, H, target_.shapes[i]);
    if (!levels) continue;
    black = std::max(black, levels->around);
    contrast = std::min(contrast, levels->inside - levels->around);
    ++(levels->pale_around > 0.3 ? touched : free);
  }
  if (touched > free) return false;
  for (size_t i = 0; i < target_.shapes.size(); ++i) {
    if (!is_square(i) || seen_[i]) continue;
    int asked = 0;
    for (size_t k = 4 * i; k < 4 * i + 4; ++k) asked += tallies_[k].asked;
    if (asked == 0) continue;
    ++unseen;
    const auto levels = levels_of(grey, H, target_.shapes[i]);
    if (levels && levels->inside < black + 0.3 * std::max(contrast, 0.0)) ++lacking;
  }
  return lacking <= (unseen == 1 && seen >= 5 ? 1 : 0);
}

std::optional<Confirmed> Confirmation::confirm(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane,
                                               double radius, const Requirement& requirement) {
  contradicted_ = false;
  Confirmed result;
  result.image_from_plane = towards_camera(image_from_plane);
  SearchOptions search;
  search.contrast = requirement.contrast;
  PlaneFit fit;
  // A step that moves nothing by more than this leaves the edges where the next search finds them.
  constexpr double kNearEnough = 2.5;  // px
  constexpr int kMaxRounds = 5;
  for (int round = 0; round < kMaxRounds; ++round) {
    const bool last = search.lines == kLastLines;
    Eigen::Matrix3d& H = result.image_from_plane;
    if (!(H(2, 2) > 0) || !H.allFinite()) return std::nullopt;
    result.frame = frame_of(H, Eigen::Vector2d::Zero(), size_);
    project_edges(target_, H, camera_, kWhole, pieces_);
    std::erase_if(pieces_,
                  [](const EdgePiece& p) { return !(std::min(p.white_room, p.black_room) > kLeastRoom); });
    search.radius = last ? 2 : std::max(2.0, radius / (1 << round));
    search_edges(grey, pieces_, result.frame, search, offsets_, steps_, tallies_);
    int asked = 0;
    for (const EdgeTally& tally : tallies_) asked += tally.asked;
    if (asked < kLeastLines || static_cast<int>(offsets_.size()) < std::max(10, asked / 3))
      return std::nullopt;
    fit = fit_plane(offsets_, result.frame, 0.3, last ? 2 : 3);
    H = towards_camera(corrected(H, result.frame, fit.step));
    result.by_one_look = requirement.is_measured_after && round == 0 && is_plain(result.frame, search.lines);
    if (last || result.by_one_look) break;
    const double moved = fit.step.norm() * result.frame.radius * camera_.intrinsics()[0];
    if (moved < kNearEnough || round + 2 == kMaxRounds) search.lines = kLastLines;
  }
  widths_.clear();
  result.contrast = median_contrast(steps_);
  for (EdgeTally& tally : tallies_) tally.found = 0;
  for (size_t i = 0; i < offsets_.size(); ++i) {
    if (std::abs(offsets_[i].left) > kInPlace || steps_[i].contrast < kLeastOfContrast * result.contrast)
      continue;
    ++tallies_[static_cast<size_t>(steps_[i].edge)].found;
    widths_.push_back(steps_[i].width);
  }
  const Eigen::Matrix3d& H = result.image_from_plane;
  for (const EdgeTally& tally : tallies_) {
    result.found += tally.found;
    result.asked += tally.asked;
  }
  if (!is_met(grey, H, requirement)) {
    contradicted_ = is_clear();
    return std::nullopt;
  }
  for (size_t i = 0; i < target_.shapes.size() && !contradicted_; ++i) {
    contradicted_ = target_.shapes[i].kind == ShapeKind::kSquare && !is_whole(i, search.lines) &&
                    is_beside(grey, H, target_.shapes[i], result.contrast);
  }
  if (contradicted_) return std::nullopt;
  if (!is_layout(grey, H)) {
    contradicted_ = is_clear();
    return std::nullopt;
  }
  if (result.by_one_look) {  // as many as a second look has
    result.found *= kLastLines / search.lines;
    result.asked *= kLastLines / search.lines;
  }
  result.seen = seen_;
  result.own = own_;
  result.partly = partly_;
  result.blur = std::clamp(median(widths_), 0.5, 3.0);
  return result;
}

}  // namespace perch
