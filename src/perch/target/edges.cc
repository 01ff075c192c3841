#include "perch/target/edges.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace perch {
namespace {

bool is_white_inside(ShapeKind kind) { return kind == ShapeKind::kSquare || kind == ShapeKind::kOutline; }

void add_shape(const TargetShape& shape, TargetEdges& target) {
  const Quad corners = square_corners(shape.centre - Eigen::Vector2d::Constant(shape.side / 2), shape.side);
  const int index = static_cast<int>(target.shapes.size());
  target.shapes.push_back(shape);
  for (size_t k = 0; k < 4; ++k) {
    TargetEdge edge;
    edge.from = corners[k];
    edge.to = corners[(k + 1) % 4];
    const Eigen::Vector2d along = (edge.to - edge.from).normalized();
    // Counterclockwise: the inside is to the left.
    const Eigen::Vector2d inward(-along.y(), along.x());
    edge.normal = is_white_inside(shape.kind) ? inward : -inward;
    edge.shape = index;
    target.edges.push_back(edge);
  }
}

void add_target(const SquaresLayout& layout, double size, double scale, const Eigen::Vector2d& centre,
                TargetEdges& target) {
  const bool inner = scale < 1;
  for (const Square& square : layout.squares) {
    const Eigen::Vector2d middle = square.lower_left + Eigen::Vector2d::Constant(square.side / 2);
    add_shape({ShapeKind::kSquare, centre + scale * middle, scale * square.side, inner}, target);
  }
  add_shape({ShapeKind::kInterior, centre, scale * (size - 2 * layout.border), inner}, target);
  if (inner || layout.outer_edge_printed) {
    add_shape({ShapeKind::kOutline, centre, scale * size, inner}, target);
  }
}

// The distance from the edge to the nearest other one that lies beside it, in the direction of `side` (1: the
// white one).
double room(const TargetEdges& target, const TargetEdge& edge, double side) {
  const Eigen::Vector2d along = (edge.to - edge.from).normalized(), across = side * edge.normal;
  const double length = (edge.to - edge.from).norm();
  double nearest = std::numeric_limits<double>::infinity();
  for (const TargetEdge& other : target.edges) {
    const Eigen::Vector2d a = other.from - edge.from, b = other.to - edge.from;
    const double distance = across.dot(a);
    if (distance < 1e-9 || std::abs(across.dot(b) - distance) > 1e-9) continue;  // behind, or not parallel
    const double start = along.dot(a), end = along.dot(b);
    const auto [low, high] = std::minmax(start, end);  // of references: they must not be to temporaries
    // A fifth of the edge more: what ends beside its end is near it too.
    if (low < 1.2 * length && high > -0.2 * length) nearest = std::min(nearest, distance);
  }
  return nearest;
}

}  // namespace

TargetEdges target_edges(const SquaresLayout& layout, double size) {
  TargetEdges target;
  add_target(layout, size, 1, Eigen::Vector2d::Zero(), target);
  if (layout.nested) {
    add_shape({ShapeKind::kHole, layout.nested->centre, layout.nested->hole, true}, target);
    add_target(layout, size, layout.nested->size / size, layout.nested->centre, target);
  }
  for (TargetEdge& edge : target.edges) {
    edge.white_room = std::min(room(target, edge, 1), layout.border);
    edge.black_room = std::min(room(target, edge, -1), layout.border);
    if (std::isinf(edge.white_room)) edge.white_room = layout.border;
  }
  return target;
}

}  // namespace perch
