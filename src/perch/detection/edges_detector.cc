#include "perch/detection/edges_detector.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <ranges>
#include <stdexcept>

#include "perch/detection/confirm.h"
#include "perch/detection/edge_fit.h"
#include "perch/detection/grey_range.h"
#include "perch/detection/hypotheses.h"
#include "perch/detection/local_contrast.h"
#include "perch/detection/picture_fit.h"
#include "perch/detection/quads.h"
#include "perch/detection/stopwatch.h"

namespace perch {
namespace {

// Regions of fewer sampled pixels are noise.
constexpr int kLeastPixels = 3;

// Of a black region's white ones; three squares may be covered.
constexpr int kLeastSquares = 3;
constexpr int kLeastRegions = 2;  // in which to look for them: a shadow's edge may break the others

// A hypothesis from regions is a few pixels off at most, one from a prediction up to as far as its
// sigma says.
constexpr double kRegionRadius = 4;       // px
constexpr double kPredictionRadius = 10;  // px, beyond which the whole picture is the better place to look

// A piece of an edge for the fine fit: an arc over this length is a parabola to a hundredth of a pixel.
constexpr double kPiece = 32;  // px

// Squares smaller than this are measured by their picture.
constexpr double kSmallSquare = 7;  // px

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
  Hypotheses hypotheses;
  Confirmation confirmation;
  EdgeFit edge_fit;
  PictureFit picture_fit;
  Detection detection;

  Segmentation segmentation;
  LocalContrast contrast;
  std::vector<WhiteQuad> quads;
  std::vector<size_t> order, members;
  std::vector<Hypothesis> proposed;
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
        hypotheses(t, edges),
        confirmation(t, edges, c),
        picture_fit(edges, c) {}

  bool holds(const Confirmed& found, const Eigen::Vector2d& pixel) const;
  bool has_stranger(const Confirmed& found) const;
  bool try_hypotheses(const cv::Mat& grey);
  void search_regions(const cv::Mat& grey, int row_step, Stopwatch& stopwatch);
  std::optional<Confirmed> follow(const cv::Mat& grey, const Prediction& prediction);
  bool is_outline(const EdgePiece& piece) const;
  void share_growth();
  std::optional<PlaneMeasurement> measure_edges(const cv::Mat& grey, const Confirmed& found);
  std::optional<PlaneMeasurement> measure_picture(const cv::Mat& grey, const Confirmed& found);
  bool measure(const cv::Mat& grey, const Confirmed& found);
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

// Whether a pixel lies on a target that was found.
bool EdgesDetector::Work::holds(const Confirmed& found, const Eigen::Vector2d& pixel) const {
  const auto ray = camera.ray_from_pixel(pixel);
  if (!ray) return false;
  const Eigen::Vector3d q = found.image_from_plane.inverse() * *ray;
  return std::abs(q.z()) > 0 && q.hnormalized().cwiseAbs().maxCoeff() < 0.5 * target.size;
}

// Whether in the black interior there is a white four-sided region that is no square of the target, nor a
// piece of one, nor what covers one: then it is another panel, of which some squares happen to lie where ours
// do.
bool EdgesDetector::Work::has_stranger(const Confirmed& found) const {
  const Eigen::Matrix3d plane_from_image = found.image_from_plane.inverse();
  const auto on_plane = [&](const Eigen::Vector2d& pixel) -> std::optional<Eigen::Vector2d> {
    const auto ray = camera.ray_from_pixel(pixel);
    if (!ray) return std::nullopt;
    return (plane_from_image * *ray).hnormalized();
  };
  double interior = 0, smallest = target.size;
  for (const TargetShape& shape : edges.shapes) {
    if (shape.inner) continue;
    if (shape.kind == ShapeKind::kInterior) interior = shape.side;
    if (shape.kind == ShapeKind::kSquare) smallest = std::min(smallest, shape.side);
  }
  const auto shapes = std::views::iota(size_t{0}, edges.shapes.size());
  const auto is_hidden = [&](size_t i) {
    return edges.shapes[i].kind == ShapeKind::kSquare && !edges.shapes[i].inner && !found.seen[i];
  };
  const auto hidden = std::ranges::count_if(shapes, is_hidden);
  for (const WhiteQuad& quad : quads) {
    if (!quad.four_sided) continue;
    std::array<Eigen::Vector2d, 4> corners;
    bool known = true;
    for (size_t k = 0; k < 4; ++k) {
      const auto corner = on_plane(quad.seen.corners[k]);
      known = known && corner;
      if (corner) corners[k] = *corner;
    }
    const auto inside = [&](const Eigen::Vector2d& c) { return c.cwiseAbs().maxCoeff() < 0.5 * interior; };
    if (!known || !std::ranges::all_of(corners, inside)) continue;
    const double side =
        0.5 * ((corners[0] - corners[2]).norm() + (corners[1] - corners[3]).norm()) / std::sqrt(2.0);
    if (side < 0.6 * smallest) continue;
    const double slack = 0.3 * smallest;
    const auto on_shape = [&](size_t i) {
      const TargetShape& shape = edges.shapes[i];
      if (shape.kind != ShapeKind::kSquare && !shape.inner) return false;
      return std::ranges::all_of(corners, [&](const Eigen::Vector2d& c) {
        return (c - shape.centre).cwiseAbs().maxCoeff() < 0.5 * shape.side + slack;
      });
    };
    if (std::ranges::any_of(shapes, on_shape)) continue;
    // What covers a square: with all others in sight, or two at once. Another panel's square does neither.
    const Eigen::Vector2d centre = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
    const auto touches = [&](size_t i) {
      return is_hidden(i) &&
             (centre - edges.shapes[i].centre).cwiseAbs().maxCoeff() < 0.5 * (edges.shapes[i].side + side);
    };
    const auto hides = [&](size_t i) {
      return is_hidden(i) && (centre - edges.shapes[i].centre).norm() < 0.5 * side;
    };
    if (hidden == 1 ? std::ranges::any_of(shapes, touches) : std::ranges::count_if(shapes, hides) >= 2)
      continue;
    return true;
  }
  return false;
}

// The best of the proposed that the picture confirms. The border looks the same after a quarter turn, and so
// do some of the squares where others are hidden: all four turns are tried.
bool EdgesDetector::Work::try_hypotheses(const cv::Mat& grey) {
  const Requirement requirement{kLeastSquares, 2, options.min_found, options.min_contrast};
  std::optional<Confirmed> best;
  const auto consider = [&](const Eigen::Matrix3d& H) {
    const auto found = confirmation.confirm(grey, H, kRegionRadius, requirement);
    if (found && (!best || found->score() > best->score())) best = found;
  };
  for (const Hypothesis& h : proposed) {
    consider(h.image_from_plane);
    // One that explains nearly everything needs no rival; of a nested target both scales are tried.
    if (best && edges.shapes.size() <= 8 && best->found > 0.85 * best->asked) break;
  }
  if (!best) return false;
  if (best->found < 0.85 * best->asked) {
    const Eigen::Matrix3d H = best->image_from_plane;
    Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
    for (int k = 1; k < 4; ++k) {
      turned = turned * Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      consider(H * turned);
    }
  }
  if (has_stranger(*best)) return false;
  confirmed.push_back(*best);
  return true;
}

void EdgesDetector::Work::search_regions(const cv::Mat& grey, int row_step, Stopwatch& stopwatch) {
  find_quads(segmentation, row_step, kLeastRegions, quads);
  stopwatch.lap("quads");
  const auto n = std::get<SquaresLayout>(target.layout).squares.size();
  order.resize(quads.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [this](size_t a, size_t b) { return quads[a].around < quads[b].around; });
  for (size_t first = 0; first < order.size();) {
    size_t last = first;
    while (last < order.size() && quads[order[last]].around == quads[order[first]].around) ++last;
    members.assign(order.begin() + static_cast<std::ptrdiff_t>(first),
                   order.begin() + static_cast<std::ptrdiff_t>(last));
    first = last;
    if (members.size() < kLeastRegions) continue;
    const auto known = [&](size_t i) {
      return std::ranges::any_of(confirmed,
                                 [&](const Confirmed& c) { return holds(c, quads[i].seen.centre); });
    };
    if (std::ranges::any_of(members, known)) continue;
    if (members.size() == n) {
      hypotheses.of_group(quads, members, camera, proposed);
      stopwatch.lap("hypotheses");
      const bool found = try_hypotheses(grey);
      stopwatch.lap("verify");
      if (found) continue;
    }
    // The largest first: they reach farthest.
    std::stable_sort(members.begin(), members.end(),
                     [this](size_t a, size_t b) { return quads[a].side_px > quads[b].side_px; });
    int seeds = 0;
    for (const size_t seed : members) {
      if (!quads[seed].four_sided || known(seed)) continue;
      if (++seeds > 12) break;
      hypotheses.of_seed(quads, seed, camera, proposed);
      stopwatch.lap("hypotheses");
      if (!proposed.empty()) try_hypotheses(grey);
      stopwatch.lap("verify");
    }
  }
}

std::optional<Confirmed> EdgesDetector::Work::follow(const cv::Mat& grey, const Prediction& prediction) {
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
  return confirmation.confirm(grey, H, std::clamp(radius, 2.0, kPredictionRadius),
                              {1, 2, options.min_found, options.min_contrast});
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

// Whether a piece lies between the target and the ground.
bool EdgesDetector::Work::is_outline(const EdgePiece& piece) const {
  const TargetEdge& edge = edges.edges[static_cast<size_t>(piece.edge)];
  const TargetShape& shape = edges.shapes[static_cast<size_t>(edge.shape)];
  return shape.kind == ShapeKind::kOutline && !shape.inner;
}

// How much of the growth each edge has. The outline's step is from a ground of any grey: what a response that
// is not linear does to it is less by its smaller modulation, from a dark ground to a pale one by the power
// 1.25 of it for sRGB; what light spread in the lens does is not.
void EdgesDetector::Work::share_growth() {
  const auto is_outline = [&](size_t i) { return on_ground[static_cast<size_t>(measured[i])] != 0; };
  double sum = 0, count = 0;
  for (size_t i = 0; i < offsets.size(); ++i) {
    if (is_outline(i)) continue;
    sum += offsets[i].modulation;
    count += 1;
  }
  for (size_t i = 0; i < offsets.size(); ++i) {
    if (!is_outline(i)) continue;
    const double part = std::min(offsets[i].modulation * count / std::max(sum, 1e-9), 1.0);
    offsets[i].white = -std::pow(part, 1.25);
    offsets[i].outline = -1;
  }
}

// By the places of its edges, to a few hundredths of a pixel each.
std::optional<PlaneMeasurement> EdgesDetector::Work::measure_edges(const cv::Mat& grey,
                                                                   const Confirmed& found) {
  PlaneMeasurement plane;
  Eigen::Matrix3d H = found.image_from_plane;
  PlaneFit fit;
  FitOptions how{(options.lines_per_edge + 3) / 4, found.blur, options.min_contrast};
  // The first round finds the blur and what is left to a tenth of a pixel, of few lines; the next all of it.
  constexpr int kMostRounds = 3;
  for (int round = 0; round < kMostRounds; ++round) {
    plane.frame = frame_of(H, Eigen::Vector2d::Zero(), target.size);
    project_edges(edges, H, camera, kPiece, pieces);
    on_ground.clear();
    for (const EdgePiece& piece : pieces) on_ground.push_back(is_outline(piece));
    edge_fit.measure(grey, pieces, on_ground, plane.frame, how, offsets, measured);
    if (offsets.size() < 10) return std::nullopt;
    share_growth();
    // What a fit to a blurred step makes of one bent by the sensor's response differs by its reach.
    const double bent = 0.1 * fit.growth;
    for (EdgeOffset& o : offsets) o.sigma = std::hypot(o.sigma, options.systematic_px, bent);
    fit = fit_plane(offsets, plane.frame, 0.3, 3);
    H = towards_camera(corrected(H, plane.frame, fit.step));
    // What is left of half a tenth of a pixel after one step is nothing.
    if (round > 0 && fit.step.norm() * plane.frame.radius * camera.intrinsics()[0] < 0.15) break;
    how = {options.lines_per_edge, std::sqrt(0.5 * edge_fit.blur().trace()), options.min_contrast};
  }
  plane.frame = frame_of(H, Eigen::Vector2d::Zero(), target.size);
  plane.image_from_plane = H;
  plane.information = fit.information / std::max(1.0, fit.scale * fit.scale);
  double weights = 0;
  for (const EdgeOffset& o : offsets) weights += o.weight / (o.sigma * o.sigma);
  plane.sigma_px = std::sqrt(static_cast<double>(offsets.size()) / weights) * std::max(1.0, fit.scale);
  plane.rms_px = fit.rms_px;
  plane.growth_px = fit.growth;
  plane.edges = static_cast<int>(offsets.size());
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

bool EdgesDetector::Work::measure(const cv::Mat& grey, const Confirmed& found) {
  double smallest = target.size;
  for (const TargetShape& shape : edges.shapes) smallest = std::min(smallest, shape.side);
  const double smallest_px = 2 * found.frame.radius * camera.intrinsics()[0] * smallest / target.size;
  std::optional<PlaneMeasurement> plane;
  if (smallest_px < kSmallSquare) plane = measure_picture(grey, found);
  if (!plane) plane = measure_edges(grey, found);
  if (!plane) return false;
  detection.plane = plane;
  add_corners(*plane);
  return true;
}

const Detection& EdgesDetector::detect(const cv::Mat& grey, const std::optional<Prediction>& prediction) {
  Work& w = *work_;
  w.detection.status = DetectionStatus::kNoTarget;
  w.detection.correspondences.clear();
  w.detection.plane.reset();
  w.detection.stages.clear();
  w.detection.threshold = -1;
  if (grey.empty() || grey.cols != w.camera.width() || grey.rows != w.camera.height()) return w.detection;

  Stopwatch stopwatch(w.detection.stages);
  w.confirmed.clear();
  if (prediction) {
    if (const auto followed = w.follow(grey, *prediction)) w.confirmed.push_back(*followed);
    stopwatch.lap("follow");
  }
  if (w.confirmed.empty()) {
    const GreyRange range = sampled_grey_range(grey, 7);
    const uint8_t level = threshold_level(range, w.options.threshold_fraction);
    w.detection.threshold = level;
    segment(grey, level, 2, kLeastPixels, w.segmentation);
    stopwatch.lap("segmentation");
    w.search_regions(grey, 2, stopwatch);
  }
  if (w.confirmed.empty()) {
    w.contrast.threshold(grey, w.options.min_contrast, w.segmentation.image);
    segment_runs(kLeastPixels, w.segmentation);
    stopwatch.lap("local segmentation");
    w.search_regions(grey, 1, stopwatch);
  }
  if (w.confirmed.empty()) return w.detection;
  if (w.confirmed.size() > 1) {
    w.detection.status = DetectionStatus::kAmbiguous;
    return w.detection;
  }
  if (w.measure(grey, w.confirmed.front())) w.detection.status = DetectionStatus::kFound;
  stopwatch.lap("measure");
  return w.detection;
}

}  // namespace perch
