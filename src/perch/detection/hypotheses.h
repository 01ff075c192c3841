#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/detection/labelling.h"
#include "perch/detection/quads.h"
#include "perch/target/edges.h"
#include "perch/target/landing_target.h"

namespace perch {

// A way to see the target in some of the white regions: image_from_plane of plane_fit.h.
struct Hypothesis {
  Eigen::Matrix3d image_from_plane = Eigen::Matrix3d::Identity();
  int squares = 0;  // how many regions it explains
};

// From white regions to hypotheses. Where a black region holds as many as the layout has squares, the paper's
// labels; else each four-sided region is taken for each square in each of its four orientations, and what of
// its neighbours then comes to lie where squares are, counts.
class Hypotheses {
 public:
  Hypotheses(const LandingTarget& target, const TargetEdges& edges);

  // All those with the region `seed` as one of their squares and two more at least, or one whose corners are
  // measured too, the best first.
  void of_seed(std::span<const WhiteQuad> quads, size_t seed, const CameraModel& camera,
               std::vector<Hypothesis>& hypotheses);
  // Those of a black region with as many white ones as the layout has squares; `members` are indices.
  void of_group(std::span<const WhiteQuad> quads, std::span<const size_t> members, const CameraModel& camera,
                std::vector<Hypothesis>& hypotheses);

 private:
  struct LayoutSquare {
    Eigen::Vector2d centre;
    double side;
  };
  std::optional<Hypothesis> refined(std::span<const WhiteQuad> quads, int scale, const Eigen::Matrix3d& H,
                                    const CameraModel& camera);

  std::vector<std::vector<LayoutSquare>> scales_;  // the outer squares, the inner ones
  std::optional<Labelling> labelling_;
  std::vector<size_t> near_;
  std::vector<SeenSquare> seen_, labelled_;
  std::vector<Eigen::Vector2d> plane_, image_;
};

}  // namespace perch
