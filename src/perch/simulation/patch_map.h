#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "perch/target/landing_target.h"

namespace perch {

// What a part of the target's plane shows, as fractions of its area; the rest is ground.
struct Coverage {
  double white = 0;
  double black = 0;
};

// The target's patches, asked for the colour of small convex areas of their plane. Coordinates are those of
// `target`, m.
//
// Most areas a picture asks for lie wholly inside one colour. A raster over the target knows for each cell
// its colour and how far the nearest edge is at least, and answers those; the others are cut by polygon
// clipping.
class PatchMap {
 public:
  // The corners of a patch must be convex; either sense of rotation will do.
  explicit PatchMap(std::span<const Patch> patches);

  // The colour of everything within `radius` of a point; empty when an edge may be that near.
  std::optional<Coverage> uniform(const Eigen::Vector2d& point, double radius) const;

  // The exact mean over a convex quadrilateral, corners in either sense; of one without area, its ground.
  Coverage mean(const Quad& area) const;

 private:
  struct Polygon;
  struct Painted {
    Quad corners;  // counterclockwise
    Eigen::Vector2d low, high;
    bool white = false;
  };
  struct Cell {
    float clearance = 0;  // no edge is nearer to any point of the cell; negative: one may lie in it
    float white = 0, black = 0;
  };

  void paint(const Polygon& polygon, size_t above, double smallest, Coverage& areas) const;
  void rasterise();

  std::vector<Painted> patches_;
  std::vector<Cell> cells_;  // rows from low y
  int columns_ = 0, rows_ = 0;
  double cell_ = 1;  // side, m
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero(), high_ = Eigen::Vector2d::Zero();
};

}  // namespace perch
