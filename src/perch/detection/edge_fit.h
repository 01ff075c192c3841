#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "perch/detection/edge_blur.h"
#include "perch/detection/edge_piece.h"
#include "perch/detection/level_surface.h"
#include "perch/detection/plane_fit.h"
#include "perch/detection/step_templates.h"

namespace perch {

struct EdgeFitOptions {
  int lines_per_edge = 64;
  double blur = 0.8;     // of the picture across edges, the pixel's own included, px
  double contrast = 12;  // of a step, at least; grey levels
  // Of the pieces that are not on the ground: where it cannot be so large a part, none is measured.
  double least_measured = 0;
};

// Measures pieces of edges to a few hundredths of a pixel: the lines across a piece, each at its own
// sub-pixel phase, are one blurred step with a dark level, a light level and an offset, found by Gauss and
// Newton about the expected place (which must be within about a pixel). Each pixel serves one line, so lines
// err independently, and the offset's sigma follows from the grey residuals.
//
// A piece that had to find its levels alone would have to look far, at what lies there, and would take an
// error of its light level for a shift; so white and black are one surface each over all pieces, where they
// agree.
class EdgeFit {
 public:
  EdgeFit();
  ~EdgeFit();

  // `on_ground`: of each piece, whether its dark side is the ground around the target, of any grey. A piece
  // whose step has the wrong sense, is too low, or ran away gives no offset. `pieces_measured` are the
  // indices of those that did.
  void measure(const cv::Mat& grey, std::span<const EdgePiece> pieces, std::span<const uint8_t> on_ground,
               const ImageFrame& frame, const EdgeFitOptions& options, std::vector<EdgeOffset>& offsets,
               std::vector<int>& pieces_measured);

  // Whether the next edge is so far from a piece that its blur leaves enough of the step.
  static bool has_room(const EdgePiece& piece, double blur_px);

  const Eigen::Matrix2d& blur() const { return blur_; }  // as in edge_blur.h

  struct Piece;

 private:
  bool fit(const cv::Mat& grey, const EdgePiece& piece, const EdgeFitOptions& options, Piece& fitted) const;
  void find_levels(std::span<const EdgePiece> pieces, std::span<const uint8_t> on_ground);
  void widen_on_ground(std::span<const uint8_t> on_ground);
  void find_blur(std::span<const EdgePiece> pieces, double expected_px);

  const StepTemplateTable& templates_ = StepTemplateTable::instance();
  std::vector<Piece> fitted_;
  std::vector<LevelSample> samples_;
  std::vector<WidthSample> widths_;
  std::vector<double> variances_;
  LevelSurface white_, black_;
  Eigen::Matrix2d blur_ = Eigen::Matrix2d::Identity();
};

}  // namespace perch
