#include "perch/detection/edges_detector.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "perch/detection/confirm.h"
#include "perch/detection/edges_measurement.h"
#include "perch/detection/grey_range.h"
#include "perch/detection/local_contrast.h"
#include "perch/detection/local_mean.h"
#include "perch/detection/picture_fit.h"
#include "perch/detection/region_search.h"
#include "perch/detection/stopwatch.h"

namespace perch {
namespace {

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

// A small target's picture is what it should be where no more pixels than this err as one.
constexpr double kAlike = 3;

// Found edges of the target's own of one whose picture is not.
constexpr double kMostlyThere = 0.78;

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

// One that is in view as a whole and has not the target's picture lies in a shadow or glare, is covered in
// part, or is another panel, of whose squares many lie half on the places of ours.
bool is_sure(const Confirmed& found) {
  return found.own >= kExplained || (found.own >= kMostlyThere && found.partly <= 1);
}

bool is_explained(const Confirmed& found) { return found.found >= kExplained * found.asked; }

PlaneMeasurement measurement_of(const PictureFitted& fitted) {
  PlaneMeasurement plane;
  plane.image_from_plane = fitted.image_from_plane;
  plane.frame = fitted.frame;
  plane.information = fitted.information;
  plane.rms_px = plane.sigma_px = fitted.rms_px;
  plane.growth_px = fitted.growth;
  plane.edges = fitted.pixels;
  return plane;
}

// The camera that takes the picture at half the size: pixel x covers 2 x and 2 x + 1.
CameraModel halved(const CameraModel& camera) {
  std::vector<double> intrinsics = camera.intrinsics();
  for (size_t i = 0; i < 2; ++i) intrinsics[i] /= 2;
  for (size_t i = 2; i < 4; ++i) intrinsics[i] = (intrinsics[i] - 0.5) / 2;
  return {camera.lens(), intrinsics, camera.width() / 2, camera.height() / 2};
}

}  // namespace

struct EdgesDetector::Work {
  LandingTarget target;
  TargetEdges edges;
  CameraModel camera;
  EdgesOptions options;
  RegionSearch regions;
  Confirmation confirmation;
  EdgesMeasurement edges_measurement;
  PictureFit picture_fit;
  Detection detection;

  Segmentation segmentation;
  LocalContrast contrast;
  LocalMean local_mean;
  std::vector<Level> halves;
  std::vector<Confirmed> confirmed;

  Work(const LandingTarget& t, const CameraModel& c, const EdgesOptions& o)
      : target(t),
        edges(target_edges(std::get<SquaresLayout>(t.layout), t.size)),
        camera(c),
        options(o),
        regions(t, edges, c, o.min_found, o.min_contrast),
        confirmation(t, edges, c),
        edges_measurement(edges, t.size, c, o),
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
  if (!(blur_px > 0) || confirmation.has_small_squares(frame)) return false;
  const auto plane =
      edges_measurement.measure(grey, expected.image_from_plane, blur_px, true, detection.residuals);
  const bool is_there = plane && std::abs(plane->blur_px - blur_px) < kSameBlur * plane->blur_px;
  if (!is_there) detection.residuals.clear();
  if (is_there) take(*plane);
  return is_there;
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
  if (confirmation.has_small_squares(found->frame)) return std::nullopt;
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
  regions.search(grey, segmentation, {.row_step = 2, .is_measured_after = true}, stopwatch, confirmed);
  if (std::ranges::any_of(confirmed, &Confirmed::by_one_look)) {
    const Confirmed& found = confirmed.front();
    const bool is_one = confirmed.size() == 1;
    const auto plane = is_one ? edges_measurement.measure(grey, found.image_from_plane, found.blur, true,
                                                          detection.residuals)
                              : std::nullopt;
    if (plane) take(*plane);
    stopwatch.lap("measure");
    if (plane) return;
    confirmed.clear();
    regions.search(grey, segmentation, {.row_step = 2}, stopwatch, confirmed);
  }
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

// By the places of its edges, or the grey levels of its picture where those cannot be told apart.
void EdgesDetector::Work::measure(const cv::Mat& grey, const Confirmed& found) {
  std::optional<PlaneMeasurement> plane;
  if (confirmation.has_small_squares(found.frame)) {
    const auto fitted =
        picture_fit.fit(grey, found.image_from_plane, target.size, found.blur, options.min_contrast);
    const bool is_alike = picture_fit.is_outside() || (fitted && fitted->together < kAlike);
    if (!is_alike && !is_sure(found)) return;
    if (fitted) plane = measurement_of(*fitted);
  }
  if (!plane) {
    plane = edges_measurement.measure(grey, found.image_from_plane, found.blur, false, detection.residuals);
  }
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
    if (w.detection.status == DetectionStatus::kFound) return w.detection;
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
