#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace perch {

// How far from a step a line is looked at, px: nearer than the first nothing can be told.
inline constexpr double kLeastReach = 1.6, kLargestReach = 7;

// A blurred step between two levels as 16 pixels of a line see it, sampled at every 64th of a pixel of its
// place: what a line is compared with. Fixed point, so that eight pixels cost one instruction.
class StepTemplates {
 public:
  static constexpr int kPixels = 16;  // -8 .. 7 about the line's middle pixel
  static constexpr int kPhases = 64;
  static constexpr int kOne = 4096;  // 1 in fixed point
  // Of the sums: inside, step, slope and narrower by themselves and with each other, x with the step.
  enum { kN, kT, kG, kTT, kTG, kGG, kW, kTW, kGW, kWW, kXT, kSums = 12 };

  struct Template {
    // Within `reach` of the step, elsewhere 0: all bits, the step from -1/2 to 1/2 (kOne is 1), its slope,
    // and the slope times the place x from the step: what a blur adds that is narrower.
    alignas(16) int16_t inside[kPixels], step[kPixels], slope[kPixels], narrower[kPixels];
    // Sums of products of them, the first counting as 1; and of x with the step.
    alignas(16) float sums[kSums];
  };

  // A step blurred by a Gaussian of `sigma` px along the line, looked at within `reach` px (at most 7).
  StepTemplates(double sigma, double reach);

  // Of a step `phase` px from the middle pixel, -1/2 .. 1/2; `phase` is replaced by what the template has.
  const Template& at(double* phase) const {
    const int k = std::clamp(static_cast<int>((*phase + 0.5) * kPhases + 0.5), 0, kPhases);
    *phase = static_cast<double>(k) / kPhases - 0.5;
    return templates_[static_cast<size_t>(k)];
  }
  double reach() const { return reach_; }

 private:
  double reach_;
  std::vector<Template> templates_;
};

// All blurs and reaches that are asked for.
class StepTemplateTable {
 public:
  // The same for all, made when it is first asked for: that takes 3 ms and 2 MB.
  static const StepTemplateTable& instance();
  // Of about `sigma`, which is replaced by what the templates have, and at most `reach`.
  const StepTemplates& of(double reach, double* sigma) const;

 private:
  StepTemplateTable();

  std::vector<StepTemplates> templates_;
  std::vector<double> sigmas_;  // of their blurs, rising
};

}  // namespace perch
