#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "perch/detection/edge_piece.h"
#include "perch/detection/plane_fit.h"

namespace perch {

// A blurred step between two levels as 16 pixels of a line see it, sampled at every 64th of a pixel of its
// place: what a line is compared with. Fixed point, so that eight pixels cost one instruction.
class StepTemplates {
 public:
  static constexpr int kPixels = 16;  // -8 .. 7 about the line's middle pixel
  static constexpr int kPhases = 64;
  static constexpr int kOne = 4096;  // 1 in fixed point

  struct Template {
    // Within `reach` of the step, elsewhere 0: all bits, the step from -1/2 to 1/2 (kOne is 1), its slope.
    alignas(16) int16_t inside[kPixels], step[kPixels], slope[kPixels];
    // Sums of products of the three, the first counting as 1.
    float n, t, g, tt, tg, gg;
  };

  // A step blurred by a Gaussian of `sigma` px along the line, looked at within `reach` px (at most 7).
  StepTemplates(double sigma, double reach);

  // Of a step `phase` px from the middle pixel, -1/2 .. 1/2; `phase` is replaced by what the template has.
  const Template& at(double* phase) const;

 private:
  std::vector<Template> templates_;
};

// All blurs and reaches that are asked for, made once.
class StepTemplateTable {
 public:
  StepTemplateTable();
  const StepTemplates& of(double sigma, double reach) const;

 private:
  std::vector<StepTemplates> templates_;
};

struct FitOptions {
  int lines_per_edge = 64;
  double blur = 0.8;  // of the picture across edges, the pixel's own included, px
};

// Measures the pieces to a few hundredths of a pixel: the lines across a piece, each at its own sub-pixel
// phase, are one blurred step with a dark level, a light level and an offset, found by Gauss and Newton about
// the expected place (which must be within about a pixel). Each pixel serves one line, so lines err
// independently, and the offset's sigma follows from the grey residuals. A piece whose step has the wrong
// sense, is lower than `contrast`, or ran away gives no offset. `pieces_measured` are the indices of those
// that did.
void fit_edges(const cv::Mat& grey, std::span<const EdgePiece> pieces, const ImageFrame& frame,
               const StepTemplateTable& templates, const FitOptions& options, double contrast,
               std::vector<EdgeOffset>& offsets, std::vector<int>& pieces_measured);

}  // namespace perch
