#include "perch/detection/edge_search.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace perch {
namespace {

constexpr int kMaxRadius = 24;

struct Step {
  double at = 0;  // along the line, from its middle pixel
  double contrast = 0, slope = 0;
};

// A line of the picture, of every `step`-th byte from its middle pixel.
struct Line {
  const uint8_t* middle;
  std::ptrdiff_t step;
  int operator[](int i) const { return middle[i * step]; }
};

// The steepest rise of `sign` times the grey values of a line of 2 n + 1 pixels, n - 1 from its middle at
// most.
std::optional<Step> steepest(const Line& line, int n, int sign, int levels) {
  const auto slope = [&](int i) { return sign * (line[i + 1] - line[i - 1]); };
  // Of equals the nearest to the middle, on the left before the right: that is the order of the lower bits.
  // So the greatest is found without branches, which a processor could only guess.
  constexpr int kOrders = 64;
  static_assert(2 * kMaxRadius <= kOrders);
  int greatest = kOrders * slope(0) + kOrders - 1;
  for (int i = 1, order = kOrders - 2; i < n; ++i, order -= 2) {
    greatest = std::max({greatest, kOrders * slope(-i) + order, kOrders * slope(i) + order - 1});
  }
  const int order = kOrders - 1 - (greatest & (kOrders - 1)), most = greatest >> 6;
  const int best = order % 2 == 1 ? -(order + 1) / 2 : order / 2;
  if (most <= 0 || most < levels) return std::nullopt;
  Step step;
  step.at = best;
  step.slope = 0.5 * most;
  if (std::abs(best) < n - 1) {
    const double before = slope(best - 1), after = slope(best + 1), bend = 2 * most - before - after;
    if (bend > 0) {
      const double off = std::clamp(0.5 * (after - before) / bend, -0.5, 0.5);
      step.at += off;
      step.slope += 0.22 * (after - before) * off;
    }
  }
  // The levels on both sides: as far as the grey goes on rising.
  int low = best - 1, high = best + 1;
  while (low > -n && low > best - 4 && sign * (line[low] - line[low - 1]) > 0) --low;
  while (high < n && high < best + 4 && sign * (line[high + 1] - line[high]) > 0) ++high;
  step.contrast = sign * (line[high] - line[low]);
  return step;
}

// The blur's deviation, of a Gaussian's greatest slope. That is of the difference over two pixels, which is
// blurred by as many more.
double width_of(const Step& step) {
  constexpr double kSlope = 0.3989, kTwoPixels = 1.0 / 3, kLeast = 0.2;  // the latter px^2
  const double width = kSlope * step.contrast / std::max(step.slope, 1.0);
  return std::sqrt(std::max(width * width - kTwoPixels, kLeast));
}

}  // namespace

void search_edges(const cv::Mat& grey, std::span<const EdgePiece> pieces, const ImageFrame& frame,
                  const SearchOptions& options, std::vector<EdgeOffset>& offsets,
                  std::vector<FoundStep>& steps, std::vector<EdgeTally>& tallies) {
  offsets.clear();
  steps.clear();
  for (EdgeTally& tally : tallies) tally = {};
  for (const EdgePiece& piece : pieces) {
    if (piece.edge >= static_cast<int>(tallies.size())) tallies.resize(static_cast<size_t>(piece.edge) + 1);
    EdgeTally& tally = tallies[static_cast<size_t>(piece.edge)];
    const double gap = std::min(piece.white_room, piece.black_room);
    const CrossingLines lines(piece, std::min(2.0, 0.2 * piece.length()));
    const double cosine = std::abs(lines.along_normal());
    const double reach = std::min(options.radius, 0.4 * gap) / cosine;
    const int n = std::clamp(static_cast<int>(std::ceil(reach)) + 1, 2, kMaxRadius);
    const int count = lines.last() - lines.first() + 1;
    if (count <= 0) continue;
    const int wanted = std::min(options.lines, count), sign = lines.along_normal() > 0 ? 1 : -1;
    for (int k = 0; k < wanted; ++k) {
      const int at = lines.first() + (2 * k + 1) * count / (2 * wanted);
      const double crossing = lines.crossing(at);
      const int middle = cvRound(crossing);
      if (at < 0 || at >= (lines.rows() ? grey.rows : grey.cols)) continue;
      if (middle < n || middle + n >= (lines.rows() ? grey.cols : grey.rows)) continue;
      ++tally.asked;
      const Line line = lines.rows()
                            ? Line{grey.ptr<uint8_t>(at) + middle, 1}
                            : Line{grey.ptr<uint8_t>(middle) + at, static_cast<std::ptrdiff_t>(grey.step[0])};
      const auto step = steepest(line, n, sign, static_cast<int>(0.5 * options.contrast));
      if (!step || step->contrast < options.contrast) continue;
      const double along_line = middle + step->at - crossing;
      if (std::abs(along_line) > reach + 0.5) continue;
      ++tally.found;
      EdgeOffset offset;
      offset.jacobian = step_jacobian(piece.image_at(lines.part(at)), piece.gradient, frame);
      offset.offset = along_line * lines.along_normal();
      offset.sigma = 0.2;
      offset.white = -1;
      offsets.push_back(offset);
      steps.push_back({piece.edge, step->contrast, width_of(*step) * cosine});
    }
  }
}

}  // namespace perch
