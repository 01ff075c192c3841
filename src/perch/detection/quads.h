#pragma once

#include <vector>

#include "perch/detection/labelling.h"
#include "perch/detection/segmentation.h"

namespace perch {

// A white region that may be a square of the target.
struct WhiteQuad {
  SeenSquare seen;          // corners in px, moved out to the square's own; of a tiny region its box's
  double side_px = 0;       // root of its area
  bool measured = false;    // what is above is more than a guess from its box
  bool four_sided = false;  // the corners are measured, and explain the area
  bool cut = false;         // by the picture's edge
  int around = 0;           // label of the black region around it
};

// From here on the corners of a region say more than its box.
inline constexpr double kSmallestMeasured = 5;  // px

// The white regions that have siblings: at least `siblings` in all in the same black region. Their boxes
// only: most are never looked at.
void list_quads(const Segmentation& s, int row_step, int siblings, std::vector<WhiteQuad>& quads);

// Measures their outlines. Holds its working memory.
class QuadTracer {
 public:
  // False where it is no quadrilateral.
  bool measure(const Segmentation& s, int row_step, WhiteQuad& quad);

 private:
  struct Outline {
    std::vector<Eigen::Vector2d> left, right;
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    double area = 0;  // px, holes filled
  };
  static void trace(const RunImage& image, const Component& component, int label, int row_step,
                    Outline& outline);
  Outline outline_;
};

}  // namespace perch
