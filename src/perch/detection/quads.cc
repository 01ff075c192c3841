#include "perch/detection/quads.h"

#include <algorithm>
#include <cmath>

#include "perch/detection/corners.h"

namespace perch {
namespace {

// Adds the next row's end to one side of a convex outline (`side` 1: the right one).
void extend(std::vector<Eigen::Vector2d>& chain, const Eigen::Vector2d& p, double side) {
  while (chain.size() >= 2) {
    const Eigen::Vector2d& a = chain[chain.size() - 2];
    const Eigen::Vector2d ab = chain.back() - a, ap = p - a;
    if (side * (ab.x() * ap.y() - ap.x() * ab.y()) > 0) break;
    chain.pop_back();
  }
  chain.push_back(p);
}

std::array<Eigen::Vector2d, 4> box_corners(const Component& c, int row_step) {
  const double left = c.left, right = c.right, top = c.top * row_step, bottom = c.bottom * row_step;
  return {Eigen::Vector2d(right, top), {left, top}, {left, bottom}, {right, bottom}};
}

double area_of(const std::array<Eigen::Vector2d, 4>& corners) {
  double twice = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % 4];
    twice += b.x() * a.y() - a.x() * b.y();
  }
  return twice / 2;
}

}  // namespace

void QuadTracer::trace(const RunImage& image, const Component& component, int label, int row_step,
                       Outline& outline) {
  outline.left.clear();
  outline.right.clear();
  outline.centre.setZero();
  outline.area = 0;
  for (int y = component.top; y <= component.bottom; ++y) {
    const RunImage::Row& row = image.rows[static_cast<size_t>(y)];
    const Run* runs = image.runs.data() + row.first;
    const Run* end = runs + row.count;
    const Run* run =
        std::lower_bound(runs, end, component.left, [](const Run& r, int column) { return r.end <= column; });
    int begin = image.width, stop = 0;
    for (; run != end && run->begin <= component.right; ++run) {
      if (run->label != label) continue;
      begin = std::min(begin, run->begin);
      stop = run->end;
    }
    if (stop <= begin) continue;
    const double length = stop - begin, v = y * row_step;
    outline.area += length * row_step;
    outline.centre += length * row_step * Eigen::Vector2d(0.5 * (begin + stop - 1), v);
    extend(outline.left, {begin, v}, -1);
    extend(outline.right, {stop - 1, v}, 1);
  }
  outline.centre /= std::max(outline.area, 1.0);
}

void list_quads(const Segmentation& s, int row_step, int siblings, std::vector<WhiteQuad>& quads) {
  quads.clear();
  const auto count = static_cast<int>(s.components.list.size());
  const auto last_row = static_cast<int>(s.image.rows.size()) - 1;
  for (int label = 1; label < count; ++label) {
    const Component& c = s.at(label);
    if (!c.white || s.is_noise(label)) continue;
    const int around = s.around(label);
    if (s.holds[static_cast<size_t>(around)] < siblings) continue;
    const int width = c.right - c.left + 1, height = (c.bottom - c.top + 1) * row_step;
    // A square seen at any angle down to 15 degrees fills a quarter of its box, whichever way it lies.
    if (c.area * row_step * 5 < width * height) continue;
    WhiteQuad quad;
    quad.around = around;
    quad.seen.corners = box_corners(c, row_step);
    quad.seen.centre = 0.5 * (quad.seen.corners[0] + quad.seen.corners[2]);
    quad.seen.component = label;
    quad.cut = c.left == 0 || c.top == 0 || c.right == s.image.width - 1 || c.bottom == last_row;
    quad.side_px = std::sqrt(static_cast<double>(c.area * row_step));
    quads.push_back(quad);
  }
}

bool QuadTracer::measure(const Segmentation& s, int row_step, WhiteQuad& quad) {
  const int label = quad.seen.component;
  trace(s.image, s.at(label), label, row_step, outline_);
  quad.measured = true;
  quad.side_px = std::sqrt(outline_.area);
  quad.seen.centre = outline_.centre;
  if (quad.side_px < kSmallestMeasured) return true;
  outline_.left.insert(outline_.left.end(), outline_.right.begin(), outline_.right.end());
  const auto corners = quad_corners(outline_.left, outline_.centre);
  if (!corners) return false;
  quad.seen.corners = *corners;
  for (auto& corner : quad.seen.corners) corner += 0.7 * (corner - quad.seen.centre).normalized();
  const double area = area_of(quad.seen.corners);
  quad.four_sided = std::abs(area - outline_.area) < 0.2 * outline_.area + 2 * quad.side_px;
  return quad.four_sided;
}

}  // namespace perch
