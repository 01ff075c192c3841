#include "perch/detection/squares_detector.h"

#include <algorithm>
#include <stdexcept>

#include "perch/detection/components.h"
#include "perch/detection/corners.h"
#include "perch/detection/grey_range.h"
#include "perch/detection/labelling.h"
#include "perch/detection/runs.h"
#include "perch/detection/stopwatch.h"

namespace perch {
namespace {

bool contains(const Component& outer, const Component& inner) {
  return outer.left < inner.left && outer.top < inner.top && outer.right > inner.right &&
         outer.bottom > inner.bottom;
}

// What a region of the second pass holds.
struct Region {
  int white = 0, black = 0;
  int area = 0;
};

}  // namespace

PaperOptions read_paper_options(Section paper) {
  PaperOptions o;
  paper.read("histogram_row_step", o.histogram_row_step, Range{1, 1000});
  paper.read("threshold_fraction", o.threshold_fraction, kFraction);
  paper.read("segmentation_row_step", o.segmentation_row_step, Range{1, 64});
  paper.read("min_component_px", o.min_component_px, Range{1, 1e6});
  paper.read("corner_inset_px", o.corner_inset_px, Range{0, 2});
  paper.read("corner_sigma_px", o.corner_sigma_px, Range{0.01, 10});
  paper.done();
  return o;
}

struct SquaresDetector::Work {
  SquaresLayout layout;
  Labelling labelling;
  PaperOptions options;
  Detection detection;

  RunImage image, foreground, window;
  Components components, regions, window_components;
  std::vector<Region> contents;  // by label of `regions`
  std::vector<int> region_of;    // by label of `components`
  std::vector<int> squares;      // labels of the candidate's squares
  std::vector<SeenSquare> seen;
  std::vector<Eigen::Vector2d> outline;

  void segment(const cv::Mat& grey, uint8_t level);
  bool find_squares(int region);
  std::optional<SeenSquare> measure(const cv::Mat& grey, uint8_t level, const Component& square);
  bool measure_candidate(const cv::Mat& grey, uint8_t level, Stopwatch& stopwatch);
};

SquaresDetector::SquaresDetector(const LandingTarget& target, const PaperOptions& options) {
  const auto* layout = std::get_if<SquaresLayout>(&target.layout);
  if (!layout) throw std::invalid_argument("detection.method paper: expected a target of squares");
  auto labelling = Labelling::of(*layout);
  if (!labelling) {
    throw std::invalid_argument(
        "detection.method paper: expected a layout with one square from which two pairs of others lie in "
        "line, "
        "as from D of sharp; " +
        target.name + " has none");
  }
  work_ = std::make_unique<Work>();
  work_->layout = *layout;
  work_->labelling = *labelling;
  work_->options = options;
}

SquaresDetector::~SquaresDetector() = default;

// Section 2.1.2: both passes, and the count of components in each foreground region.
void SquaresDetector::Work::segment(const cv::Mat& grey, uint8_t level) {
  threshold_to_runs(grey, level, options.segmentation_row_step, image);
  label_components(image, components);
  foreground_runs(image, foreground);
  label_components(foreground, regions);

  region_of.assign(components.list.size(), Components::kFrame);
  for (size_t y = 0; y < image.rows.size(); ++y) {
    const auto& pieces = image.rows[y];
    int k = foreground.rows[y].first;
    for (int i = pieces.first; i < pieces.first + pieces.count; ++i) {
      const Run& run = image.runs[static_cast<size_t>(i)];
      while (foreground.runs[static_cast<size_t>(k)].end < run.end) ++k;
      region_of[static_cast<size_t>(run.label)] = foreground.runs[static_cast<size_t>(k)].label;
    }
  }
  contents.assign(regions.list.size(), Region{});
  for (size_t label = 1; label < components.list.size(); ++label) {
    const Component& c = components.list[label];
    if (!components.is_root(static_cast<int>(label)) || c.area < options.min_component_px) continue;
    Region& region = contents[static_cast<size_t>(region_of[label])];
    ++(c.white ? region.white : region.black);
    region.area += c.area;
  }
}

// The labels of the squares of a region that may be the target; false when it cannot be.
bool SquaresDetector::Work::find_squares(int region) {
  squares.clear();
  int border = Components::kFrame;
  const auto at = [&](int label) -> const Component& { return components.list[static_cast<size_t>(label)]; };
  for (size_t i = 1; i < components.list.size(); ++i) {
    const int label = static_cast<int>(i);
    const Component& c = components.list[i];
    if (region_of[i] != region || !components.is_root(label) || !c.white || c.area < options.min_component_px)
      continue;
    squares.push_back(label);
    if (border == Components::kFrame || contains(c, at(border))) border = label;
  }
  std::erase(squares, border);
  if (layout.nested) {
    // The inner target's parts lie inside the square that holds it.
    const std::vector<int> all = squares;
    std::erase_if(squares, [&](int inner) {
      return std::any_of(all.begin(), all.end(), [&](int outer) { return contains(at(outer), at(inner)); });
    });
  }
  return squares.size() == layout.squares.size() &&
         std::all_of(squares.begin(), squares.end(), [&](int s) { return contains(at(border), at(s)); });
}

// Section 2.1.3 at full resolution: the square's outline from every row of its neighbourhood.
std::optional<SeenSquare> SquaresDetector::Work::measure(const cv::Mat& grey, uint8_t level,
                                                         const Component& square) {
  const int step = options.segmentation_row_step;
  // The rows that were skipped may belong to the square; and a pixel of margin, so that it ends inside the
  // window.
  const cv::Rect wanted(square.left - step, square.top * step - step,
                        square.right - square.left + 1 + 2 * step,
                        (square.bottom - square.top) * step + 1 + 2 * step);
  const cv::Rect box = wanted & cv::Rect(0, 0, grey.cols, grey.rows);
  threshold_to_runs(grey(box), level, 1, window);
  label_components(window, window_components);
  // The box is the square's own: what else is white in it are corners of its neighbours, which are smaller.
  const auto& list = window_components.list;
  int best = Components::kFrame;
  for (size_t i = 1; i < list.size(); ++i) {
    if (!window_components.is_root(static_cast<int>(i)) || !list[i].white) continue;
    if (best == Components::kFrame || list[i].area > list[static_cast<size_t>(best)].area)
      best = static_cast<int>(i);
  }
  if (best == Components::kFrame) return std::nullopt;

  const Component& found = list[static_cast<size_t>(best)];
  outline.clear();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (int y = found.top; y <= found.bottom; ++y) {
    const auto& row = window.rows[static_cast<size_t>(y)];
    for (int i = row.first; i < row.first + row.count; ++i) {
      const Run& run = window.runs[static_cast<size_t>(i)];
      if (run.label != best) continue;
      const double length = run.end - run.begin;
      sum += length * Eigen::Vector2d(0.5 * (run.begin + run.end - 1), y);
      outline.emplace_back(run.begin, y);
      outline.emplace_back(run.end - 1, y);
    }
  }
  SeenSquare seen_square;
  seen_square.centre = sum / found.area;
  const auto corners = quad_corners(outline, seen_square.centre);
  if (!corners) return std::nullopt;
  const Eigen::Vector2d origin(box.x, box.y);
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d outward = ((*corners)[i] - seen_square.centre).normalized();
    seen_square.corners[i] = (*corners)[i] + options.corner_inset_px * outward + origin;
  }
  seen_square.centre += origin;
  return seen_square;
}

// Corners and labels of the candidate in `squares`.
bool SquaresDetector::Work::measure_candidate(const cv::Mat& grey, uint8_t level, Stopwatch& stopwatch) {
  seen.clear();
  for (const int label : squares) {
    const auto square = measure(grey, level, components.list[static_cast<size_t>(label)]);
    if (!square) break;
    seen.push_back(*square);
  }
  stopwatch.lap("corners");
  const auto labelled = labelling.label(seen);
  if (labelled) {
    int feature = 0;
    for (const auto& square : *labelled) {
      for (const auto& corner : square.corners) {
        detection.correspondences.push_back({feature++, corner, options.corner_sigma_px});
      }
    }
  }
  stopwatch.lap("labelling");
  return labelled.has_value();
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
  w.segment(grey, level);
  stopwatch.lap("segmentation");

  const int white = static_cast<int>(w.layout.squares.size()) + 1;
  for (size_t region = 1; region < w.contents.size(); ++region) {
    const Region& r = w.contents[region];
    // A nested target's inner parts are counted only from near.
    const bool counts = w.layout.nested ? r.white >= white && r.black >= 1 : r.white == white && r.black == 1;
    if (!counts || !w.find_squares(static_cast<int>(region))) continue;
    if (w.measure_candidate(grey, level, stopwatch)) {
      w.detection.status = DetectionStatus::kFound;
      break;
    }
  }
  return w.detection;
}

}  // namespace perch
