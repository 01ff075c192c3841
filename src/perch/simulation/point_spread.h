#pragma once

#include <vector>

namespace perch {

// How a lens spreads light: a Gaussian. Pixels are square and collect light all over their area, so what a
// small cell of the picture sends to the pixel d to its right is the Gaussian integrated over cell and pixel,
//
//   w(d) = int_cell dx int_{d-1/2}^{d+1/2} dy g(y - x),        in units of the cell's radiance,
//
// and the same in y. A sampled Gaussian instead would put steps of a pixel's width into every edge.
class PointSpread {
 public:
  static constexpr int kMaxRadius = 31;  // px

  // Each pixel has `cells` x `cells` cells. sigma_px 0: no spreading; throws std::invalid_argument when it is
  // negative or above kMaxRadius / 4.
  PointSpread(double sigma_px, int cells);

  int radius() const { return radius_; }  // pixels beyond it get less than 1e-4 of the light
  int cells() const { return cells_; }

  // Weights of the pixels -radius() .. radius(), 2 radius() + 1 of them: of cell `cell` (0 the leftmost) of
  // pixel 0, and of the whole pixel. The sum over all cells and pixels is 1.
  const float* of_cell(int cell) const { return weights_.data() + cell * (2 * radius_ + 1); }
  const float* of_pixel() const { return whole_.data(); }

 private:
  int radius_ = 0, cells_ = 1;
  std::vector<float> weights_;
  std::vector<float> whole_;
};

}  // namespace perch
