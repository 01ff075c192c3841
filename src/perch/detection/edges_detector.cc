#include "perch/detection/edges_detector.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "perch/detection/confirm.h"
#include "perch/detection/edge_fit.h"
#include "perch/detection/grey_range.h"
#include "perch/detection/local_contrast.h"
#include "perch/detection/local_mean.h"
#include "perch/detection/picture_fit.h"
#include "perch/detection/region_search.h"
#include "perch/detection/stopwatch.h"

namespace perch {
namespace {

// By what the sigmas of so many offsets are to be multiplied, whose scatter about the fit is `scale` sigmas.
// Where they scatter less, as the noise of the dark is not that of an edge's middle, the fit has taken a part
// of the scatter, and a few tell it roughly.
double spread_of(double scale, size_t offsets) {
  constexpr double kFitted = 9, kBelieved = 30;
  if (scale >= 1) return scale;
  const auto n = static_cast<double>(offsets);
  return std::min(1.0, std::sqrt((n * scale * scale + kBelieved) / (n + kBelieved - kFitted)));
}

// Regions of fewer sampled pixels are noise.
constexpr int kLeastPixels = 3;

// Three squares of six may be covered.
constexpr int kLeastSquares = 3;

// How far the window of a local mean reaches: a small square of 2.5 px and one of 15 have black on both sides
// within it, and larger ones are seen in the picture at half the size.
constexpr int kReach = 7;  // px

// How often the picture is halved, and the smallest that still is.
constexpr size_t kMostHalves = 3;
constexpr int kLeastSide = 100;  // px

// A prediction is off by as much as its sigma says, at most so far.
constexpr double kPredictionRadius = 10;  // px, beyond which the whole picture is the better place to look

// Found edges of those asked for: what explains as many where it was expected needs no rival.
constexpr double kExplained = 0.85;

// A piece of an edge for the fine fit: an arc over this length is a parabola to a hundredth of a pixel.
constexpr double kPiece = 32;  // px

// A first look at the edges is the last where it moves none of them by more than this, finds the blur that
// was expected, to a part of it, and at least this part of the pieces of the target's own edges.
constexpr double kStill = 0.3;  // px
constexpr double kSameBlur = 0.15, kMostPieces = 0.9;
constexpr int kMostLooks = 3;

// How far a fit to a blurred step is off one bent by the sensor's response differs by its reach: by this part
// of the growth.
constexpr double kBent = 0.1;

// No lens is sharper, its pixels included; what seems to be is drawn without a lens.
constexpr double kSharpest = 0.45;  // px

// Squares smaller than this are measured by their picture.
constexpr double kSmallSquare = 7;  // px

// The picture at half the size of the one before, where noise and blur are half as large.
struct Level {
  cv::Mat grey;
  CameraModel camera;
  RegionSearch regions;
};

// Where the frames before lead to expect the target.
struct Predicted {
  Eigen::Matrix3d image_from_plane;
  double radius = 0;  // px that its edges may be off, as it claims
};

bool is_explained(const Confirmed& found) { return found.found >= kExplained * found.asked; }

// The camera that takes the picture at half the size: pixel x covers 2 x and 2 x + 1.
CameraModel halved(const CameraModel& camera) {
  std::vector<double> intrinsics = camera.intrinsics();
  for (size_t i = 0; i < 2; ++i) intrinsics[i] /= 2;
  for (size_t i = 2; i < 4; ++i) intrinsics[i] = (intrinsics[i] - 0.5) / 2;
  return {camera.lens(), intrinsics, camera.width() / 2, camera.height() / 2};
}

}  // namespace

EdgesOptions read_edges_options(Section edges) {
  EdgesOptions o;
  edges.read("threshold_fraction", o.threshold_fraction, kFraction);
  edges.read("lines_per_edge", o.lines_per_edge, Range{1, 100000});
  edges.read("min_contrast", o.min_contrast, Range{1, 255});
  edges.read("min_found", o.min_found, kFraction);
  edges.read("systematic_px", o.systematic_px, Range{0, 10});
  edges.done();
  return o;
}

struct EdgesDetector::Work {
  LandingTarget target;
  TargetEdges edges;
  CameraModel camera;
  EdgesOptions options;
  RegionSearch regions;
  Confirmation confirmation;
  EdgeFit edge_fit;
  PictureFit picture_fit;
  Detection detection;

  Segmentation segmentation;
  LocalContrast contrast;
  LocalMean local_mean;
  std::vector<Level> halves;
  std::vector<Confirmed> confirmed;
  std::vector<EdgePiece> pieces;
  std::vector<EdgeOffset> offsets;
  std::vector<int> measured;
  std::vector<uint8_t> on_ground;

  Work(const LandingTarget& t, const CameraModel& c, const EdgesOptions& o)
      : target(t),
        edges(target_edges(std::get<SquaresLayout>(t.layout), t.size)),
        camera(c),
        options(o),
        regions(t, edges, c, o.min_found, o.min_contrast),
        confirmation(t, edges, c),
        picture_fit(edges, c) {
    halves.reserve(kMostHalves);
    const CameraModel* last = &camera;
    while (halves.size() < kMostHalves && std::min(last->width(), last->height()) >= kLeastSide) {
      const CameraModel half = halved(*last);
      halves.push_back({{}, half, {t, edges, half, o.min_found, o.min_contrast}});
      last = &halves.back().camera;
    }
  }

  void search(const cv::Mat& grey, Stopwatch& stopwatch);
  void search_means(const cv::Mat& grey, RegionSearch& search_regions, Stopwatch& stopwatch);
  std::optional<Predicted> predicted(const Prediction& prediction) const;
  bool measure_predicted(const cv::Mat& grey, const Predicted& expected, double blur_px);
  std::optional<Confirmed> follow(const cv::Mat& grey, const Predicted& expected);
  bool is_outline(const TargetEdge& edge) const;
  double smallest_square_px(const ImageFrame& frame) const;
  void share_growth();
  bool is_all_in_view() const;
  bool is_most_measured() const;
  std::optional<PlaneMeasurement> measure_edges(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane,
                                                double blur_px, bool is_predicted);
  std::optional<PlaneMeasurement> measure_picture(const cv::Mat& grey, const Confirmed& found);
  void measure(const cv::Mat& grey, const Confirmed& found);
  void take(const PlaneMeasurement& plane);
  void add_corners(const PlaneMeasurement& plane);
};

EdgesDetector::EdgesDetector(const LandingTarget& target, const CameraModel& camera,
                             const EdgesOptions& options) {
  if (!std::holds_alternative<SquaresLayout>(target.layout)) {
    throw std::invalid_argument("detection.method edges: expected a target of squares");
  }
  work_ = std::make_unique<Work>(target, camera, options);
  if (work_->edges.shapes.size() > kMostShapes) {
    throw std::invalid_argument("detection.method edges: expected a target of at most " +
                                std::to_string(kMostShapes) + " squares and borders");
  }
}

EdgesDetector::~EdgesDetector() = default;

double EdgesDetector::Work::smallest_square_px(const ImageFrame& frame) const {
  double smallest = target.size;
  for (const TargetShape& shape : edges.shapes) smallest = std::min(smallest, shape.side);
  return 2 * frame.radius * camera.intrinsics()[0] * smallest / target.size;
}

std::optional<Predicted> EdgesDetector::Work::predicted(const Prediction& prediction) const {
  const auto& [mean, covariance] = prediction.camera_from_target;
  const Eigen::Matrix3d R = mean.rotation.toRotationMatrix();
  Eigen::Matrix3d H;
  H << R.col(0), R.col(1), mean.translation;
  if (!(mean.translation.z() > 0)) return std::nullopt;
  // How far off the target's middle and rim may be: three sigma.
  const double focal = camera.intrinsics()[0], distance = mean.translation.norm();
  const double shift = std::sqrt(covariance.diagonal().head<3>().maxCoeff()) / distance;
  const double turn = std::sqrt(covariance.diagonal().tail<3>().maxCoeff()) * 0.5 * target.size / distance;
  const double radius = 3 * focal * std::hypot(shift, turn);
  // A prediction is mostly far better than what it promises; one that is not is not confirmed.
  if (!(radius < 0.5 * focal * target.size / distance)) return std::nullopt;
  return Predicted{H, radius};
}

// Mostly the edges are within a fraction of a pixel of where they are expected: where nearly all of them are,
// of all squares and the border, and as blurred as before, that confirms the target as nothing else does.
bool EdgesDetector::Work::measure_predicted(const cv::Mat& grey, const Predicted& expected, double blur_px) {
  const ImageFrame frame = frame_of(expected.image_from_plane, Eigen::Vector2d::Zero(), target.size);
  if (!(blur_px > 0) || smallest_square_px(frame) < kSmallSquare) return false;
  const auto plane = measure_edges(grey, expected.image_from_plane, blur_px, true);
  if (plane) take(*plane);
  return plane.has_value();
}

std::optional<Confirmed> EdgesDetector::Work::follow(const cv::Mat& grey, const Predicted& expected) {
  const Requirement requirement{1, 2, options.min_found, options.min_contrast};
  auto found = confirmation.confirm(grey, expected.image_from_plane,
                                    std::clamp(expected.radius, 2.0, kPredictionRadius), requirement);
  if (!found || is_explained(*found)) return found;
  int squares = 0;
  for (size_t i = 0; i < edges.shapes.size(); ++i) {
    squares += edges.shapes[i].kind == ShapeKind::kSquare && found->seen[i];
  }
  if (squares < kLeastSquares) return std::nullopt;
  // Small ones have no room beside them in which another panel's would show.
  if (smallest_square_px(found->frame) < kSmallSquare) return std::nullopt;
  // Turned in itself by a quarter, the target still shows all of its border and half of its squares.
  for (int quarters = 1; quarters < 4; ++quarters) {
    const Eigen::Matrix3d turned(Eigen::AngleAxisd(quarters * M_PI / 2, Eigen::Vector3d::UnitZ()));
    if (confirmation.confirm(grey, found->image_from_plane * turned, 8, requirement)) return std::nullopt;
  }
  return found;
}

// In the whole picture: what one threshold shows, and where that is nothing, ever more local ones.
void EdgesDetector::Work::search(const cv::Mat& grey, Stopwatch& stopwatch) {
  const GreyRange range = sampled_grey_range(grey, 7);
  const uint8_t level = threshold_level(range, options.threshold_fraction);
  detection.threshold = level;
  segment(grey, level, 2, kLeastPixels, segmentation);
  stopwatch.lap("segmentation");
  regions.search(grey, segmentation, {.row_step = 2}, stopwatch, confirmed);
  if (!confirmed.empty()) return;
  contrast.threshold(grey, options.min_contrast, segmentation.image);
  segment_runs(kLeastPixels, segmentation);
  stopwatch.lap("local segmentation");
  regions.search(grey, segmentation, {}, stopwatch, confirmed);
  search_means(grey, regions, stopwatch);
  const cv::Mat* last = &grey;
  for (size_t k = 0; k < halves.size() && confirmed.empty(); ++k) {
    halve(*last, halves[k].grey);
    last = &halves[k].grey;
    search_means(*last, halves[k].regions, stopwatch);
    // At full size, if that is not where it drowns in noise.
    std::erase_if(confirmed, [&](Confirmed& found) {
      const double radius = 2 << k;
      const Requirement requirement{kLeastSquares, 2, options.min_found, options.min_contrast};
      if (const auto sharper = confirmation.confirm(grey, found.image_from_plane, radius, requirement)) {
        found = *sharper;
      } else {
        found.blur = std::clamp(found.blur * (2 << k), 0.5, 3.0);
      }
      return confirmation.is_contradicted();
    });
  }
}

void EdgesDetector::Work::search_means(const cv::Mat& grey, RegionSearch& search_regions,
                                       Stopwatch& stopwatch) {
  if (!confirmed.empty()) return;
  local_mean.threshold(grey, kReach, static_cast<int>(options.min_contrast / 2), segmentation.image);
  segment_runs(kLeastPixels, segmentation);
  stopwatch.lap("local segmentation");
  search_regions.search(grey, segmentation, {.pooled = true}, stopwatch, confirmed);
}

// Where the target's corners are, as far as they are in the picture.
void EdgesDetector::Work::add_corners(const PlaneMeasurement& plane) {
  for (size_t i = 0; i < target.features.size(); ++i) {
    const Eigen::Vector3d p = plane.image_from_plane * target.features[i].point.homogeneous();
    const auto pixel = p.z() > 0 ? camera.pixel_from_camera(p) : std::nullopt;
    if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > camera.width() - 1 ||
        pixel->y() > camera.height() - 1) {
      continue;
    }
    detection.correspondences.push_back({static_cast<int>(i), *pixel, std::max(plane.rms_px, 0.02)});
  }
}

// Whether an edge lies between the target and the ground.
bool EdgesDetector::Work::is_outline(const TargetEdge& edge) const {
  const TargetShape& shape = edges.shapes[static_cast<size_t>(edge.shape)];
  return shape.kind == ShapeKind::kOutline && !shape.inner;
}

// How much of the growth each edge has. The outline's step is from a ground of any grey: what a response that
// is not linear does to it is less by its smaller modulation, from a dark ground to a pale one by the power
// 1.25 of it for sRGB; what light spread in the lens does is not.
void EdgesDetector::Work::share_growth() {
  const auto by_ground = [&](size_t i) { return on_ground[static_cast<size_t>(measured[i])] != 0; };
  double sum = 0, count = 0;
  for (size_t i = 0; i < offsets.size(); ++i) {
    if (by_ground(i)) continue;
    sum += offsets[i].modulation;
    count += 1;
  }
  for (size_t i = 0; i < offsets.size(); ++i) {
    if (!by_ground(i)) continue;
    const double part = std::min(offsets[i].modulation * count / std::max(sum, 1e-9), 1.0);
    offsets[i].white = -std::pow(part, 1.25);
    offsets[i].outline = -1;
  }
}

// Whether the whole target is: both ends of each of its own edges.
bool EdgesDetector::Work::is_all_in_view() const {
  std::ptrdiff_t ends = 0;
  for (size_t i = 0; i < pieces.size(); ++i) {
    if (!on_ground[i]) ends += pieces[i].first + pieces[i].last;
  }
  return ends ==
         2 * std::ranges::count_if(edges.edges, [&](const TargetEdge& edge) { return !is_outline(edge); });
}

// Of the target's own edges: the ground beside its outline may be as pale.
bool EdgesDetector::Work::is_most_measured() const {
  const auto own = static_cast<double>(std::ranges::count(on_ground, 0));
  const auto found =
      std::ranges::count_if(measured, [&](int i) { return on_ground[static_cast<size_t>(i)] == 0; });
  return static_cast<double>(found) >= kMostPieces * own;
}

// By the places of its edges, to a few hundredths of a pixel each.
std::optional<PlaneMeasurement> EdgesDetector::Work::measure_edges(const cv::Mat& grey,
                                                                   const Eigen::Matrix3d& image_from_plane,
                                                                   double blur_px, bool is_predicted) {
  PlaneMeasurement plane;
  Eigen::Matrix3d H = image_from_plane;
  PlaneFit fit;
  EdgeFitOptions how{options.lines_per_edge, blur_px, options.min_contrast};
  double bent = 0;
  const auto fit_widened = [&](double by) {
    for (EdgeOffset& o : offsets) o.sigma = std::hypot(o.sigma, by);
    fit = fit_plane(offsets, plane.frame, 0.3, 3);
  };
  bool is_settled = false;
  for (int look = 1; !is_settled && look <= kMostLooks; ++look) {
    plane.frame = frame_of(H, Eigen::Vector2d::Zero(), target.size);
    project_edges(edges, H, camera, kPiece, pieces);
    on_ground.clear();
    for (const EdgePiece& piece : pieces)
      on_ground.push_back(is_outline(edges.edges[static_cast<size_t>(piece.edge)]));
    if (is_predicted && look == 1 && !is_all_in_view()) return std::nullopt;
    how.least_measured = is_predicted && look == 1 ? kMostPieces : 0;
    edge_fit.measure(grey, pieces, on_ground, plane.frame, how, offsets, measured);
    if (offsets.size() < 10) return std::nullopt;
    share_growth();
    fit_widened(std::hypot(options.systematic_px, bent));
    const double now_bent = kBent * std::abs(fit.growth);
    if (now_bent > bent + options.systematic_px) fit_widened(std::sqrt(now_bent * now_bent - bent * bent));
    bent = now_bent;
    H = towards_camera(corrected(H, plane.frame, fit.step));
    const double blur = std::max(std::sqrt(0.5 * edge_fit.blur().trace()), kSharpest);
    const bool as_expected = std::abs(blur - how.blur) < kSameBlur * blur && is_most_measured();
    if (is_predicted && look == 1 && !as_expected) return std::nullopt;
    const double moved = fit.step.norm() * plane.frame.radius * camera.intrinsics()[0];
    is_settled = moved < kStill && (look > 1 || as_expected);
    // What goes on moving is no target.
    if (look == kMostLooks && moved > 0.5 * blur) return std::nullopt;
    how.blur = blur;
  }
  plane.frame = frame_of(H, Eigen::Vector2d::Zero(), target.size);
  plane.image_from_plane = H;
  const double spread = spread_of(fit.scale, offsets.size());
  plane.information = fit.information / (spread * spread);
  double weights = 0;
  for (const EdgeOffset& o : offsets) weights += o.weight / (o.sigma * o.sigma);
  plane.sigma_px = std::sqrt(static_cast<double>(offsets.size()) / weights) * spread;
  plane.rms_px = fit.rms_px;
  plane.growth_px = fit.growth;
  plane.blur_px = how.blur;
  plane.edges = static_cast<int>(offsets.size());
  for (size_t i = 0; i < offsets.size(); ++i) {
    const EdgePiece& piece = pieces[static_cast<size_t>(measured[i])];
    detection.residuals.push_back(
        {piece.middle.cast<float>(), piece.normal.cast<float>(), static_cast<float>(offsets[i].left)});
  }
  return plane;
}

// By the grey levels of its picture, where its edges cannot be told apart.
std::optional<PlaneMeasurement> EdgesDetector::Work::measure_picture(const cv::Mat& grey,
                                                                     const Confirmed& found) {
  const auto fitted =
      picture_fit.fit(grey, found.image_from_plane, target.size, found.blur, options.min_contrast);
  if (!fitted) return std::nullopt;
  PlaneMeasurement plane;
  plane.image_from_plane = fitted->image_from_plane;
  plane.frame = fitted->frame;
  plane.information = fitted->information;
  plane.rms_px = plane.sigma_px = fitted->rms_px;
  plane.growth_px = fitted->growth;
  plane.edges = fitted->pixels;
  return plane;
}

void EdgesDetector::Work::measure(const cv::Mat& grey, const Confirmed& found) {
  std::optional<PlaneMeasurement> plane;
  if (smallest_square_px(found.frame) < kSmallSquare) plane = measure_picture(grey, found);
  if (!plane) plane = measure_edges(grey, found.image_from_plane, found.blur, false);
  if (plane) take(*plane);
}

void EdgesDetector::Work::take(const PlaneMeasurement& plane) {
  detection.plane = plane;
  detection.status = DetectionStatus::kFound;
  add_corners(plane);
}

const Detection& EdgesDetector::detect(const cv::Mat& grey, const std::optional<Prediction>& prediction) {
  Work& w = *work_;
  w.detection.status = DetectionStatus::kNoTarget;
  w.detection.correspondences.clear();
  w.detection.plane.reset();
  w.detection.residuals.clear();
  w.detection.stages.clear();
  w.detection.threshold = -1;
  if (grey.empty() || grey.cols != w.camera.width() || grey.rows != w.camera.height()) return w.detection;

  Stopwatch stopwatch(w.detection.stages);
  w.confirmed.clear();
  std::optional<Confirmed> followed;
  if (const auto expected = prediction ? w.predicted(*prediction) : std::nullopt) {
    const bool is_there = w.measure_predicted(grey, *expected, prediction->blur_px);
    if (!is_there) followed = w.follow(grey, *expected);
    stopwatch.lap("follow");
    if (is_there) return w.detection;
  }
  // Where much is missing of what was expected, the whole picture may have something better.
  if (followed && is_explained(*followed)) {
    w.confirmed.push_back(*followed);
  } else {
    w.search(grey, stopwatch);
    if (followed && w.confirmed.empty()) w.confirmed.push_back(*followed);
  }
  if (w.confirmed.empty()) return w.detection;
  if (w.confirmed.size() > 1) {
    w.detection.status = DetectionStatus::kAmbiguous;
    return w.detection;
  }
  w.measure(grey, w.confirmed.front());
  stopwatch.lap("measure");
  return w.detection;
}

}  // namespace perch
