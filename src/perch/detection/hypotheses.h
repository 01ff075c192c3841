#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/detection/labelling.h"
#include "perch/detection/plane_fit.h"
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
  Hypotheses(const LandingTarget& target, const TargetEdges& edges, const CameraModel& camera);

  // The regions of a picture, which must outlive the calls below.
  void begin(std::span<const WhiteQuad> quads);
  // The regions that may belong to one target, as indices.
  void begin_group(std::span<const size_t> members);
  // All those with the region `seed` as one of their squares and two more of the group at least, or one whose
  // corners are measured too, the best first.
  void of_seed(size_t seed, std::vector<Hypothesis>& hypotheses);
  // Those of a black region with as many white ones as the layout has squares; `members` are indices.
  void of_group(std::span<const size_t> members, std::vector<Hypothesis>& hypotheses);

 private:
  struct LayoutSquare {
    Eigen::Vector2d centre;
    double side;
  };
  // A region in the ideal image.
  struct Mark {
    bool tried = false, seen = false;
    Eigen::Vector2d centre;
    std::array<Eigen::Vector2d, 4> corners;
  };
  // One that may belong to the same target as the seed.
  struct Near {
    double x, y;  // in the ideal image
    double side_px;
    size_t quad;
  };
  struct Match {
    const LayoutSquare* square;
    size_t quad;
  };
  const Mark* mark(size_t quad);
  struct SideBounds {
    double low, high;  // px
  };
  std::optional<size_t> nearest_to(const Eigen::Vector2d& place, double reach, const SideBounds& side) const;
  void match(int scale, const Eigen::Matrix3d& H, double tolerance);
  bool has_corners(const Match& match) const;
  bool is_enough() const;
  bool is_firm(std::span<const Match> matches) const;
  size_t sort_cut();
  std::optional<Eigen::Matrix3d> fitted(const Eigen::Matrix3d& H);
  std::optional<Eigen::Matrix3d> by_centres();
  std::optional<Hypothesis> refined(int scale, const Eigen::Matrix3d& H);

  CameraModel camera_;
  double px_;                                      // in the ideal image
  double size_;                                    // of the target, m
  std::vector<std::vector<LayoutSquare>> scales_;  // the outer squares, the inner ones
  std::optional<Labelling> labelling_;
  std::span<const WhiteQuad> quads_;
  std::vector<Mark> marks_;
  std::vector<size_t> by_x_;  // of a group
  std::vector<Near> near_;    // of a seed, by x
  std::vector<Match> matches_;
  std::vector<SeenSquare> seen_, labelled_;
  std::vector<Eigen::Vector2d> plane_, image_;
  std::vector<EdgeOffset> offsets_;
};

}  // namespace perch
