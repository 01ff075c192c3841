#include <algorithm>
#include <cmath>
#include <numeric>

#include "perch/target/layouts.h"
#include "perch/target/tag_shape.h"

namespace perch {
namespace {

// A tag on the board with its shape, m.
struct Placed {
  Tag tag;
  TagShape shape;

  double module() const { return tag.size / shape.edge; }
  Eigen::Vector2d in_target(const Eigen::Vector2d& in_modules) const {
    const double c = std::cos(tag.yaw), s = std::sin(tag.yaw);
    const Eigen::Vector2d p = module() * in_modules;
    return tag.centre + Eigen::Vector2d(c * p.x() - s * p.y(), s * p.x() + c * p.y());
  }
  Quad in_target(const Quad& in_modules) const {
    Quad quad;
    std::transform(in_modules.begin(), in_modules.end(), quad.begin(),
                   [&](const Eigen::Vector2d& p) { return in_target(p); });
    return quad;
  }
  Quad square(double side) const {
    return in_target(square_corners(Eigen::Vector2d::Constant(-side / 2), side));
  }
};

// Tags nearer than this touch: rounding of metres.
constexpr double kTouch = 1e-9;

// Whether some side of `a` has all of `b` on its outer side; `a` goes counterclockwise.
bool side_separates(const Quad& a, const Quad& b) {
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d along = (a[(k + 1) % 4] - a[k]).normalized();
    const Eigen::Vector2d outward(along.y(), -along.x());
    if (std::all_of(b.begin(), b.end(), [&](const auto& p) { return outward.dot(p - a[k]) > kTouch; }))
      return true;
  }
  return false;
}

// Whether all of `b` lies inside `a`.
bool surrounds(const Quad& a, const Quad& b) {
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d along = (a[(k + 1) % 4] - a[k]).normalized();
    const Eigen::Vector2d inward(-along.y(), along.x());
    if (!std::all_of(b.begin(), b.end(), [&](const auto& p) { return inward.dot(p - a[k]) > -kTouch; }))
      return false;
  }
  return true;
}

// Convex shapes are apart when a side of one of them separates them; a tag in another's free centre is no
// part of its code either.
bool apart(const Placed& a, const Placed& b) {
  const Quad outline_a = a.square(a.shape.footprint), outline_b = b.square(b.shape.footprint);
  if (side_separates(outline_a, outline_b) || side_separates(outline_b, outline_a)) return true;
  return (a.shape.free_centre > 0 && surrounds(a.square(a.shape.free_centre), outline_b)) ||
         (b.shape.free_centre > 0 && surrounds(b.square(b.shape.free_centre), outline_a));
}

TagFamily read_family(Section& section, AprilTagBoard& board) {
  std::string names;
  for (const std::string& name : tag_family_names()) names += (names.empty() ? "" : ", ") + name;
  section.read("family", board.family);
  // A border far wider than the data is a slip.
  section.read("border", board.border, Range{1, 4});
  TagFamily family = make_tag_family(board.family, board.border);
  if (!family) section.fail("family", "one of " + names);
  if (board.border != 1 && !has_black_border(*family)) {
    section.fail("border", "1 with " + board.family + ", which has a white border");
  }
  return family;
}

Tag read_tag(Section& entry, const apriltag_family_t& family) {
  Tag tag;
  require(entry, "id", "the tag's number in its family");
  entry.read("id", tag.id, Range{0, static_cast<double>(family.ncodes) - 1});
  require(entry, "size", "the side of the border's outer edge in m");
  entry.read("size", tag.size, kPrintable);
  std::vector<double> centre{0, 0};
  entry.read("center", centre, 2, Range{-kPrintable.max, kPrintable.max});
  tag.centre = {centre[0], centre[1]};
  entry.read("yaw", tag.yaw);
  if (std::abs(tag.yaw) > 2 * M_PI)
    entry.fail("yaw", "an angle in rad, a turn (6.28) at most");  // not degrees
  entry.done();
  return tag;
}

std::vector<Placed> read_tags(Section& section, const AprilTagBoard& board, const apriltag_family_t& family) {
  require(section, "tags", "a list of at least one {id, size, center, yaw}");
  std::vector<Placed> tags;
  for (Section& entry : section.list("tags")) {
    const Tag tag = read_tag(entry, family);
    const Placed placed{tag, tag_shape(family, tag.id, board.border)};
    for (const Placed& other : tags) {
      const std::string id = std::to_string(other.tag.id);
      if (tag.id == other.tag.id) entry.fail("id", "each id once", id + " a second time");
      if (!apart(placed, other)) entry.fail("center", "a tag clear of tag " + id, "both overlap or touch");
    }
    tags.push_back(placed);
  }
  if (tags.empty()) section.fail("tags", "a list of at least one {id, size, center, yaw}");
  return tags;
}

void add_features(const std::vector<Placed>& tags, LandingTarget& target) {
  for (const Placed& placed : tags) {
    const Quad corners = placed.square(placed.shape.edge);
    for (size_t k = 0; k < 4; ++k) {
      const std::string name = "tag" + std::to_string(placed.tag.id) + "." + std::to_string(k);
      target.features.push_back({corners[k], name});
    }
  }
}

// All quiet zones first, so that none paints over a neighbour; then the larger tags before the smaller ones,
// which may stand in their centres.
void add_patches(std::vector<Placed> tags, LandingTarget& target) {
  std::stable_sort(tags.begin(), tags.end(),
                   [](const Placed& a, const Placed& b) { return a.tag.size > b.tag.size; });
  for (const Placed& placed : tags) {
    if (placed.shape.quiet_zone == 0) continue;
    target.patches.push_back({placed.square(placed.shape.footprint + 2 * placed.shape.quiet_zone), true});
  }
  for (const Placed& placed : tags) {
    for (const Patch& patch : placed.shape.patches) {
      target.patches.push_back({placed.in_target(patch.corners), patch.white});
    }
  }
}

}  // namespace

void read_apriltag(Section& section, LandingTarget& target) {
  AprilTagBoard board;
  const TagFamily family = read_family(section, board);
  const std::vector<Placed> tags = read_tags(section, board, *family);
  for (const Placed& placed : tags) board.tags.push_back(placed.tag);
  target.layout = board;
  add_features(tags, target);
  add_patches(tags, target);
  const Bounds bounds = printed_bounds(target);
  target.size = (bounds.upper_right - bounds.lower_left).maxCoeff();
}

}  // namespace perch
