#include "perch/detection/squares_detector.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "perch/detection/grey_range.h"
#include "perch/detection/labelling.h"
#include "perch/detection/nested.h"
#include "perch/detection/segmentation.h"
#include "perch/detection/square_corners.h"
#include "perch/detection/stopwatch.h"

namespace perch {

PaperOptions read_paper_options(Section paper) {
  PaperOptions o;
  paper.read("histogram_row_step", o.histogram_row_step, Range{1, 1000});
  paper.read("threshold_fraction", o.threshold_fraction, kFraction);
  paper.read("segmentation_row_step", o.segmentation_row_step, Range{1, 64});
  paper.read("min_component_px", o.min_component_px, Range{1, 1e6});
  paper.read("count_region", o.count_region);
  paper.read("corner_inset_px", o.corner_inset_px, Range{0, 2});
  paper.read("corner_sigma_px", o.corner_sigma_px, Range{0.01, 10});
  paper.done();
  return o;
}

struct SquaresDetector::Work {
  SquaresLayout layout;
  size_t holder = 0;        // index of the square that holds a nested target
  double holder_side = 0;   // m
  int inner_features = -1;  // index of the inner target's first feature
  Labelling labelling;
  PaperOptions options;
  Detection detection;

  Segmentation segmentation;
  SquareCorners corners;
  std::vector<int> candidates;  // labels of their interiors, the largest first
  std::vector<int> squares;     // labels of a candidate's squares
  std::vector<SeenSquare> seen, labelled;

  bool may_be_target(int interior);
  void find_candidates();
  std::optional<int> first_feature(int interior) const;
  bool measure_candidate(const cv::Mat& grey, uint8_t level, int interior, Stopwatch& stopwatch);
};

SquaresDetector::SquaresDetector(const LandingTarget& target, const PaperOptions& options) {
  const auto* layout = std::get_if<SquaresLayout>(&target.layout);
  if (!layout) throw std::invalid_argument("detection.method paper: expected a target of squares");
  auto labelling = Labelling::of(*layout);
  if (!labelling) {
    throw std::invalid_argument(
        "detection.method paper: expected a layout with one square from which two pairs of others lie in "
        "line, as from D of sharp; " +
        target.name + " has none");
  }
  work_ = std::make_unique<Work>();
  work_->layout = *layout;
  work_->labelling = *labelling;
  work_->options = options;
  if (!layout->nested) return;
  for (size_t i = 0; i < layout->squares.size(); ++i) {
    if (layout->squares[i].label == layout->nested->in) work_->holder = i;
  }
  work_->holder_side = layout->squares[work_->holder].side;
  work_->inner_features = static_cast<int>(4 * layout->squares.size());
}

SquaresDetector::~SquaresDetector() = default;

// Section 2.1.2: the region holds seven white components and one black one. Which one is what, the paper
// leaves open; six of them lie in the black one, and that, as it is black, in the seventh.
bool SquaresDetector::Work::may_be_target(int interior) {
  Segmentation& s = segmentation;
  const int n = static_cast<int>(layout.squares.size());
  if (s.holds[static_cast<size_t>(interior)] != n || s.is_noise(interior) || s.at(interior).white)
    return false;
  // Of a nested target, the hole and the inner target are counted too, from near.
  if (layout.nested || !options.count_region) return true;
  const auto counts = counts_in_region_of(interior, s);
  return counts.white == n + 1 && counts.black == 1;
}

void SquaresDetector::Work::find_candidates() {
  candidates.clear();
  for (int label = 1; label < static_cast<int>(segmentation.components.list.size()); ++label) {
    if (may_be_target(label)) candidates.push_back(label);
  }
  const auto box = [this](int label) {
    const Component& c = segmentation.at(label);
    return int64_t{c.right - c.left + 1} * (c.bottom - c.top + 1);
  };
  std::sort(candidates.begin(), candidates.end(), [&](int a, int b) {
    return std::pair(box(a), -a) > std::pair(box(b), -b);  // never two alike: the order is one
  });
}

// The index of the feature that the first labelled corner is; empty when the candidate of a nested layout is
// neither of its targets for certain.
std::optional<int> SquaresDetector::Work::first_feature(int interior) const {
  if (!layout.nested) return 0;
  const int square = labelled[holder].component;
  const double side_px = std::sqrt(segmentation.at(square).area * options.segmentation_row_step);
  const Nested& nested = *layout.nested;
  switch (nested_part(segmentation, {segmentation.around(interior), square, side_px},
                      nested.hole / holder_side, nested.size / nested.hole)) {
    case NestedPart::kOuter:
      return 0;
    case NestedPart::kInner:
      return inner_features;
    case NestedPart::kUnknown:
      break;
  }
  return std::nullopt;
}

// Corners and labels of the candidate with this interior.
bool SquaresDetector::Work::measure_candidate(const cv::Mat& grey, uint8_t level, int interior,
                                              Stopwatch& stopwatch) {
  held_by(segmentation, interior, squares);
  seen.clear();
  for (const int label : squares) {
    auto square = corners.measure(grey, level, options.segmentation_row_step, segmentation.image,
                                  segmentation.at(label));
    if (!square) break;
    square->component = label;
    seen.push_back(*square);
  }
  stopwatch.lap("corners");
  const bool found = labelling.label(seen, labelled);
  const auto first = found ? first_feature(interior) : std::nullopt;
  stopwatch.lap("labelling");
  if (!first) return false;
  int feature = *first;
  for (const auto& square : labelled) {
    for (const auto& corner : square.corners) {
      const Eigen::Vector2d outward = (corner - square.centre).normalized();
      detection.correspondences.push_back(
          {feature++, corner + options.corner_inset_px * outward, options.corner_sigma_px});
    }
  }
  return true;
}

const Detection& SquaresDetector::detect(const cv::Mat& grey, const std::optional<Prediction>&) {
  Work& w = *work_;
  w.detection.status = DetectionStatus::kNoTarget;
  w.detection.correspondences.clear();
  w.detection.stages.clear();
  w.detection.threshold = -1;
  if (grey.empty()) return w.detection;

  Stopwatch stopwatch(w.detection.stages);
  const GreyRange range = sampled_grey_range(grey, w.options.histogram_row_step);
  const uint8_t level = threshold_level(range, w.options.threshold_fraction);
  w.detection.threshold = level;
  stopwatch.lap("histogram");
  segment(grey, level, w.options.segmentation_row_step, w.options.min_component_px, w.segmentation);
  w.find_candidates();
  stopwatch.lap("segmentation");
  for (const int interior : w.candidates) {
    if (!w.measure_candidate(grey, level, interior, stopwatch)) continue;
    w.detection.status = DetectionStatus::kFound;
    break;
  }
  return w.detection;
}

}  // namespace perch
