#pragma once

#include <Eigen/Core>
#include <vector>

#include "perch/target/landing_target.h"

namespace perch {

// A square outline between black and white; its four edges are edges[4 i .. 4 i + 3] of shape i.
enum class ShapeKind {
  kSquare,    // white, on the black interior
  kInterior,  // the border's inner edge: black, in the white border
  kOutline,   // the border's outer edge: white, on a ground of any grey
  kHole,      // black, in a white square: a nested target lies in it
};

struct TargetShape {
  ShapeKind kind = ShapeKind::kSquare;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // m
  double side = 0;                                   // m
  bool inner = false;                                // of the nested target
  // Whether its edges lie between the target and the ground.
  bool is_on_ground() const { return kind == ShapeKind::kOutline && !inner; }
};

// One side of a shape, in the target's plane, m.
struct TargetEdge {
  Eigen::Vector2d from = Eigen::Vector2d::Zero(), to = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();  // unit, from black to white
  // How far it is to the next edge on either side, anywhere along this one. Outside of the outline as much as
  // the border is wide: what lies there nobody knows.
  double white_room = 0, black_room = 0;
  int shape = 0;
};

struct TargetEdges {
  std::vector<TargetShape> shapes;  // the squares in the layout's order, the interior, the outline; of a
                                    // nested target the hole and then the same of the inner one
  std::vector<TargetEdge> edges;
};

// Every edge of a layout of squares that may be measured: a cut outline may not.
TargetEdges target_edges(const SquaresLayout& layout, double size);

}  // namespace perch
