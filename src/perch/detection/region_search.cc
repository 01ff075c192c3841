#include "perch/detection/region_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <ranges>

namespace perch {
namespace {

// Of a black region's white ones; three squares may be covered.
constexpr int kLeastSquares = 3;
constexpr size_t kLeastRegions = 2;  // in which to look for them

// A hypothesis from regions is a few pixels off at most.
constexpr double kRegionRadius = 4;  // px

// Of the pairs of white and black next to each other that a hypothesis predicts, before its edges are looked
// for. Three covered squares of six leave two thirds.
constexpr double kLeastInOrder = 0.55;

// Found edges of those asked for: what explains as many needs no rival.
constexpr double kExplained = 0.85;

// Of the edges asked for: one that has so many of them there outdoes one that has no more than so many.
constexpr double kWholly = 0.97, kClearlyLess = 0.94;

// The sum of the part of edges found and the part of the pairs in order. In 2118 random scenes none of the
// wrong ones that four squares of another place suggested had more than 1.28, none of the right ones less
// than 1.41. Where three squares are all, wrong ones had up to 1.66 but no more than 0.93 in order, right
// ones 1.55 and mostly all in order: others must be out of sight, not out of order.
constexpr double kLeastSure = 1.38;
constexpr double kLeastSureOfThree = 1.5, kLeastInOrderOfThree = 0.92;

// Searches for edges in one picture's regions: no ground takes longer than this many.
constexpr int kMostTries = 60;

// Regions of a black one that may hold a second target, in squares of the layout.
constexpr size_t kMostBeside = 3;

// Regions of a group that are taken for each square in turn.
constexpr int kMostSeeds = 400;

}  // namespace

RegionSearch::RegionSearch(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera,
                           double min_found, double min_contrast)
    : target_(target),
      edges_(edges),
      camera_(camera),
      requirement_{kLeastSquares, 2, min_found, min_contrast},
      squares_(std::get<SquaresLayout>(target.layout).squares.size()),
      hypotheses_(target, edges, camera),
      grey_order_(edges, camera),
      confirmation_(target, edges, camera) {}

bool RegionSearch::is_known(const Eigen::Vector2d& pixel) const {
  return std::ranges::any_of(areas_, [&](const TargetArea& area) { return area.holds(pixel); });
}

// Those with about as many regions as the layout has squares first, of these the largest.
void RegionSearch::make_groups(bool pooled) {
  order_.resize(quads_.size());
  for (size_t i = 0; i < order_.size(); ++i) order_[i] = i;
  if (pooled) {
    for (WhiteQuad& quad : quads_) quad.around = 0;
  }
  // Within a group the largest first: they reach farthest.
  std::ranges::sort(order_, [this](size_t a, size_t b) {
    const WhiteQuad &p = quads_[a], &q = quads_[b];
    if (p.around != q.around) return p.around < q.around;
    return p.side_px != q.side_px ? p.side_px > q.side_px : a < b;
  });
  groups_.clear();
  for (size_t first = 0; first < order_.size();) {
    size_t last = first;
    while (last < order_.size() && quads_[order_[last]].around == quads_[order_[first]].around) ++last;
    if (last - first >= kLeastRegions)
      groups_.push_back({first, last - first, quads_[order_[first]].side_px});
    first = last;
  }
  const auto unlike = [this](const Group& g) {
    return g.count > squares_ ? g.count - squares_ : squares_ - g.count;
  };
  std::ranges::sort(groups_, [&](const Group& a, const Group& b) {
    if (unlike(a) != unlike(b)) return unlike(a) < unlike(b);
    return a.largest != b.largest ? a.largest > b.largest : a.first < b.first;
  });
}

bool RegionSearch::is_quad(const Picture& picture, WhiteQuad& quad) {
  if (quad.measured) return quad.four_sided || quad.side_px < kSmallestMeasured;
  return tracer_.measure(picture.segmentation, picture.row_step, quad);
}

int RegionSearch::squares_of(const Confirmed& found) const {
  int squares = 0;
  for (size_t i = 0; i < edges_.shapes.size(); ++i)
    squares += edges_.shapes[i].kind == ShapeKind::kSquare && found.seen[i];
  return squares;
}

// Whether one that has as much grey in its order, turned by quarters, is not what is there: of four squares
// and more every edge is where it should be, and many of the rival's are not.
bool RegionSearch::outdoes(const Confirmed& best, const std::optional<Confirmed>& rival) const {
  if (squares_of(best) <= kLeastSquares || confirmation_.has_small_squares(best.frame)) return false;
  if (best.found < kWholly * best.asked) return false;
  return !rival || rival->found < kClearlyLess * rival->asked;
}

bool RegionSearch::is_sure_enough(const Confirmed& found, double in_order) const {
  const int squares = squares_of(found);
  const double sum = in_order + static_cast<double>(found.found) / found.asked;
  if (squares > kLeastSquares) return sum >= kLeastSure;
  return sum >= kLeastSureOfThree && in_order >= kLeastInOrderOfThree;
}

// The best of the proposed that the picture confirms.
//
// The border looks the same after a quarter turn, and so do some of the squares where others are hidden or
// too small for a search of their edges. All four turns are tried, and the one that stands must have more
// grey in its order than each of the others, or outdo it.
bool RegionSearch::try_hypotheses(const Picture& picture, std::vector<Confirmed>& found) {
  const cv::Mat& grey = picture.grey;
  std::optional<Confirmed> best;
  const auto order_of = [&](const Eigen::Matrix3d& H, double least) {
    const double contrast = best ? kLeastOfContrast * best->contrast : 0;
    return grey_order_.part_in_order(grey, H, std::max(contrast, 0.5 * requirement_.contrast), least);
  };
  const auto consider = [&](const Eigen::Matrix3d& H) {
    if (tries_ == 0 || order_of(H, kLeastInOrder) < kLeastInOrder) return;
    --tries_;
    const auto confirmed = confirmation_.confirm(grey, H, kRegionRadius, requirement_);
    if (confirmed && (!best || confirmed->score() > best->score())) best = confirmed;
  };
  const auto is_explained = [&] { return best && best->found > kExplained * best->asked; };
  for (const Hypothesis& h : proposed_) {
    consider(h.image_from_plane);
    // One that explains nearly everything needs no rival; of a nested target both scales are tried.
    if (edges_.shapes.size() <= 8 && is_explained()) break;
  }
  if (!best) return false;
  const auto turned = [](const Eigen::Matrix3d& H, int quarters) -> Eigen::Matrix3d {
    return H * Eigen::AngleAxisd(quarters * M_PI / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  };
  const auto rivals = [&](const Eigen::Matrix3d& H, double order) {
    std::array<bool, 4> as_good{};
    for (int k = 1; k < 4; ++k) as_good[static_cast<size_t>(k)] = order_of(turned(H, k), order) >= order;
    return as_good;
  };
  const Eigen::Matrix3d first = best->image_from_plane;
  double order = order_of(first, 0);
  auto as_good = rivals(first, order);
  const bool is_sure = is_explained();
  for (int k = 1; k < 4; ++k) {
    if (!is_sure || as_good[static_cast<size_t>(k)]) consider(turned(first, k));
  }
  if (best->image_from_plane != first) {
    order = order_of(best->image_from_plane, 0);
    as_good = rivals(best->image_from_plane, order);
  }
  for (int k = 1; k < 4; ++k) {
    if (!as_good[static_cast<size_t>(k)]) continue;
    const auto rival =
        confirmation_.confirm(grey, turned(best->image_from_plane, k), kRegionRadius, requirement_);
    if (!outdoes(*best, rival)) return false;
  }
  if (!is_sure_enough(*best, order)) return false;
  const TargetArea area(target_, edges_, camera_, *best);
  for (WhiteQuad& quad : quads_) {
    if (quad.cut || !area.may_hold(quad.seen.centre) || !is_quad(picture, quad)) continue;
    // A whole piece of a square whose outline is not there: a window's pane.
    if (area.is_stranger(quad) || area.piece_of(quad) || area.is_beside(quad)) return false;
  }
  found.push_back(*best);
  areas_.push_back(area);
  return true;
}

void RegionSearch::search_group(const Picture& picture, const Group& group, Stopwatch& stopwatch,
                                std::vector<Confirmed>& found) {
  members_.clear();
  for (const size_t i : std::span(order_).subspan(group.first, group.count)) {
    if (is_quad(picture, quads_[i])) members_.push_back(i);
  }
  stopwatch.lap("quads");
  const auto known = [&](size_t i) { return is_known(quads_[i].seen.centre); };
  if (members_.size() == squares_) {
    if (std::ranges::any_of(members_, known)) return;
    hypotheses_.of_group(members_, proposed_);
    stopwatch.lap("hypotheses");
    const bool is_found = !proposed_.empty() && try_hypotheses(picture, found);
    stopwatch.lap("verify");
    if (is_found) return;
  }
  int seeds = 0;
  for (const size_t seed : members_) {
    if (tries_ == 0 || seeds == kMostSeeds) break;
    if (!quads_[seed].four_sided || quads_[seed].cut || known(seed)) continue;
    if (seeds == 0) hypotheses_.begin_group(members_);
    ++seeds;
    hypotheses_.of_seed(seed, proposed_);
    if (proposed_.empty()) continue;
    stopwatch.lap("hypotheses");
    try_hypotheses(picture, found);
    stopwatch.lap("verify");
  }
  stopwatch.lap("hypotheses");
}

void RegionSearch::search(const cv::Mat& grey, const Segmentation& segmentation, const Regions& regions,
                          Stopwatch& stopwatch, std::vector<Confirmed>& found) {
  const Picture picture{grey, segmentation, regions.row_step};
  requirement_.is_measured_after = regions.is_measured_after;
  list_quads(segmentation, regions.row_step, regions.pooled ? 1 : static_cast<int>(kLeastRegions), quads_);
  make_groups(regions.pooled);
  areas_.clear();
  for (const Confirmed& known : found) areas_.emplace_back(target_, edges_, camera_, known);
  stopwatch.lap("quads");
  hypotheses_.begin(quads_);
  tries_ = kMostTries;
  for (const Group& group : groups_) {
    // Beside a target that is there for sure, another one is looked for where its border is whole: only then
    // two are as good as each other. What lies in the ground's black is too much to be asked for that.
    const bool is_sure =
        std::ranges::any_of(found, [](const Confirmed& c) { return c.found > kExplained * c.asked; });
    if (is_sure && group.count > kMostBeside * squares_) continue;
    search_group(picture, group, stopwatch, found);
  }
}

}  // namespace perch
