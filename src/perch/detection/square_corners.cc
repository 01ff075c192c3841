#include "perch/detection/square_corners.h"

#include <algorithm>
#include <cmath>

#include "perch/detection/corners.h"

namespace perch {
namespace {

// A right answer of four corners explains how many pixels the square has: with the polygon through the
// corners' pixel centres, Pick's theorem says area + b / 2 + 1, where b, the lattice points on its sides, is
// at most the perimeter. A round blob, a triangle, two squares grown together do not add up: a circle has
// 57 % more. Beyond the paper, which checks nothing.
bool explained(const std::array<Eigen::Vector2d, 4>& corners, double pixels) {
  double twice_area = 0, perimeter = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d& b = corners[(i + 1) % 4];
    twice_area += b.x() * a.y() - a.x() * b.y();  // counterclockwise where y points down
    perimeter += (b - a).norm();
  }
  // A quarter of the perimeter is the middle of what b / 2 can be; twice that, and a fifth of the square, is
  // left to blur and noise.
  return std::abs(pixels - (twice_area / 2 + perimeter / 4 + 1)) <= perimeter / 2 + 0.2 * pixels;
}

// Adds the next row's end to one side of a convex outline (`side` 1: the right one, -1: the left one): the
// ends before it that are not outside the line to it go.
void extend(std::vector<cv::Point>& chain, const cv::Point& p, int side) {
  while (chain.size() >= 2) {
    const cv::Point& a = chain[chain.size() - 2];
    const cv::Point ab = chain.back() - a, ap = p - a;
    if (side * (ab.x * ap.y - ap.x * ab.y) > 0) break;
    chain.pop_back();
  }
  chain.push_back(p);
}

// The span of `row`, beside the row `from` whose span is `s`: from its first to its last pixel that touches a
// white one of `from`, and outwards from there as far as it is white, within `bounds`. The way along an edge
// is short, so the pixels are looked at one by one.
SquareCorners::Span followed(const uint8_t* row, const uint8_t* from, uint8_t level, SquareCorners::Span s,
                             const SquareCorners::Span& bounds) {
  const auto touches = [&](int x) { return std::min(row[x], from[x]) > level; };
  while (s.begin < s.end && !touches(s.begin)) ++s.begin;
  if (s.empty()) return s;
  while (!touches(s.end - 1)) --s.end;
  while (s.begin > bounds.begin && row[s.begin - 1] > level) --s.begin;
  while (s.end < bounds.end && row[s.end] > level) ++s.end;
  return s;
}

SquareCorners::Span joined(const SquareCorners::Span& a, const SquareCorners::Span& b) {
  if (a.empty() || b.empty()) return a.empty() ? b : a;
  return {std::min(a.begin, b.begin), std::max(a.end, b.end)};
}

}  // namespace

std::optional<SeenSquare> SquareCorners::measure(const cv::Mat& grey, uint8_t level, int row_step,
                                                 const RunImage& sampled, const Component& square) {
  // The rows that were skipped may belong to the square, and it may be a little wider in them.
  const int top = std::max((square.top - 1) * row_step, 0);
  const int bottom = std::min((square.bottom + 1) * row_step, grey.rows - 1);
  const Span bounds{std::max(square.left - row_step, 0), std::min(square.right + 1 + row_step, grey.cols)};
  // Down from the run that it was first seen by, and back up as far as it goes. Noise tears a flat edge into
  // pieces, and a span takes them all in only on the way from a wider row to a narrower one: each way has its
  // edges.
  const Run& first = sampled.runs[static_cast<size_t>(square.first_run)];
  const int seed_y = square.top * row_step;
  spans_.assign(static_cast<size_t>(bottom - top + 1), Span{});
  const auto span_at = [&](int y) -> Span& { return spans_[static_cast<size_t>(y - top)]; };
  // The span of row y as the one of row `from` continues.
  const auto beside = [&](int from, int y) {
    return followed(grey.ptr<uint8_t>(y), grey.ptr<uint8_t>(from), level, span_at(from), bounds);
  };
  int y = seed_y;
  span_at(y) = {first.begin, first.end};
  while (y < bottom && !span_at(y).empty()) {
    span_at(y + 1) = beside(y, y + 1);
    ++y;
  }
  if (span_at(y).empty()) --y;
  const int last_y = y;
  while (y > top && !span_at(y).empty()) {
    --y;
    span_at(y) = joined(span_at(y), beside(y + 1, y));
  }
  if (span_at(y).empty()) ++y;

  // From the window's corner, so that rounding, which picks among points equally far, does not depend on
  // where in the picture the square is.
  const cv::Point origin(bounds.begin, top);
  // Only corners of the convex hull can be farthest in any direction: some sixteen of hundreds of row ends.
  left_.clear();
  right_.clear();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double pixels = 0;
  for (; y <= last_y; ++y) {
    const Span span = span_at(y);
    const double length = span.end - span.begin;
    pixels += length;
    sum += length * Eigen::Vector2d(0.5 * (span.begin + span.end - 1) - origin.x, y - origin.y);
    extend(left_, cv::Point(span.begin, y) - origin, -1);
    extend(right_, cv::Point(span.end - 1, y) - origin, 1);
  }
  outline_.clear();
  for (const auto* side : {&left_, &right_}) {
    for (const cv::Point& p : *side) outline_.emplace_back(p.x, p.y);
  }
  const Eigen::Vector2d centre = sum / pixels;
  const auto corners = quad_corners(outline_, centre);
  if (!corners || !explained(*corners, pixels)) return std::nullopt;
  const Eigen::Vector2d offset(origin.x, origin.y);
  SeenSquare seen{centre + offset, *corners};
  for (auto& corner : seen.corners) corner += offset;
  return seen;
}

}  // namespace perch
