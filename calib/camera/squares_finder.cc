#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "calib/camera/board_finder.h"
#include "calib/camera/edge_width.h"
#include "perch/detection/edge_fit.h"
#include "perch/detection/edges_detector.h"

namespace perch {
namespace {

// Pieces of an edge this long are measured one by one, px: the smallest squares have two on each side.
constexpr double kPiece = 16;

// What each piece is off by that no residual shows: print and lens within it, px.
constexpr double kSystematic = 0.005;

// An edge as it runs beside where it was expected: offset towards white, px, by the place along it, 0 at its
// beginning and 1 at its end. Polynomials: the lens that is not known yet bends edges.
struct EdgeCourse {
  Eigen::VectorXd coefficients;
  Eigen::MatrixXd covariance;

  double at(double t) const { return powers(t, coefficients.size()).dot(coefficients); }
  double variance(double t) const {
    const Eigen::VectorXd p = powers(t, coefficients.size());
    return p.dot(covariance * p);
  }
  static Eigen::VectorXd powers(double t, Eigen::Index count) {
    Eigen::VectorXd p(count);
    for (Eigen::Index i = 0; i < count; ++i) p[i] = std::pow(2 * t - 1, static_cast<double>(i));
    return p;
  }
};

struct PieceOffset {
  double t = 0, offset = 0, sigma = 1;
};

std::optional<EdgeCourse> fit_course(const std::vector<PieceOffset>& pieces) {
  if (pieces.empty()) return std::nullopt;
  // A corner lies at an edge's end: an edge seen in its middle alone does not tell of it.
  const auto [low, high] = std::minmax_element(pieces.begin(), pieces.end(),
                                               [](const auto& a, const auto& b) { return a.t < b.t; });
  if (pieces.size() > 1 && high->t - low->t < 0.4) return std::nullopt;
  const Eigen::Index terms = pieces.size() >= 5 ? 3 : pieces.size() >= 2 ? 2 : 1;
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(terms, terms);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(terms);
  for (const PieceOffset& piece : pieces) {
    const Eigen::VectorXd p = EdgeCourse::powers(piece.t, terms);
    const double weight = 1 / (piece.sigma * piece.sigma);
    N += weight * p * p.transpose();
    y += weight * piece.offset * p;
  }
  EdgeCourse course{Eigen::VectorXd(), N.inverse()};
  course.coefficients = course.covariance * y;
  // Pieces that scatter by more than they should know about it.
  double chi2 = 0;
  for (const PieceOffset& piece : pieces)
    chi2 += std::pow((piece.offset - course.at(piece.t)) / piece.sigma, 2);
  const auto freedom = static_cast<double>(pieces.size()) - static_cast<double>(terms);
  if (freedom > 0) course.covariance *= std::max(1.0, chi2 / freedom);
  if (!course.coefficients.allFinite()) return std::nullopt;
  return course;
}

class SquaresFinder : public BoardFinder {
 public:
  SquaresFinder(const TargetBoard& board, const std::optional<CameraModel>& lens)
      : board_(board), lens_(lens) {}

  BoardSighting find(const cv::Mat& grey) override {
    if (grey.cols != width_ || grey.rows != height_) prepare(grey.cols, grey.rows);
    BoardSighting best;
    bool ambiguous = false;
    for (Try& one : tries_) {
      const Detection& found = one.detector->detect(grey, std::nullopt);
      ambiguous = ambiguous || found.status == DetectionStatus::kAmbiguous;
      if (found.status != DetectionStatus::kFound || !found.plane) continue;
      BoardSighting sighting;
      sighting.corners = measure(grey, one.lens, *found.plane);
      if (sighting.corners.size() > best.corners.size()) best = sighting;
      // Another lens would find the same again.
      if (best.corners.size() == board_.places.size()) break;
    }
    if (best.corners.size() < 8) {
      best.corners.clear();
      best.problem = ambiguous ? "several targets " + board_.target.name : "no target " + board_.target.name;
    }
    best.blur_px = edge_width(grey, best.corners);
    return best;
  }

 private:
  struct Try {
    CameraModel lens;
    std::unique_ptr<EdgesDetector> detector;
  };

  void prepare(int width, int height) {
    width_ = width;
    height_ = height;
    tries_.clear();
    const double cx = 0.5 * (width - 1), cy = 0.5 * (height - 1), w = width;
    std::vector<CameraModel> lenses;
    if (lens_ && lens_->width() == width && lens_->height() == height) {
      lenses = {*lens_};
    } else {
      // A homography takes up any focal length; what it cannot is how much the lens bends: none, and what a
      // lens of 100 and of 140 degrees bends.
      lenses.push_back(CameraModel::pinhole(w, w, cx, cy, width, height));
      for (const double f : {0.55 * w, 0.35 * w}) {
        lenses.emplace_back("LENSMODEL_STEREOGRAPHIC", std::vector<double>{f, f, cx, cy}, width, height);
      }
    }
    for (const CameraModel& lens : lenses) {
      tries_.push_back({lens, std::make_unique<EdgesDetector>(board_.target, lens, EdgesOptions{})});
    }
  }

  std::vector<BoardCorner> measure(const cv::Mat& grey, const CameraModel& lens,
                                   const PlaneMeasurement& plane);
  std::optional<BoardCorner> corner(const CameraModel& lens, const PlaneMeasurement& plane, size_t shape,
                                    size_t k, const std::vector<std::optional<EdgeCourse>>& courses) const;

  TargetBoard board_;
  std::optional<CameraModel> lens_;
  int width_ = 0, height_ = 0;
  std::vector<Try> tries_;
  EdgeFit edge_fit_;
  std::vector<EdgePiece> pieces_;
  std::vector<EdgeOffset> offsets_;
  std::vector<int> measured_;
};

// The plane's homography through a lens that is not the true one is no measurement; each edge's own course
// beside it is.
std::vector<BoardCorner> SquaresFinder::measure(const cv::Mat& grey, const CameraModel& lens,
                                                const PlaneMeasurement& plane) {
  project_edges(board_.edges, plane.image_from_plane, lens, kPiece, pieces_);
  const std::vector<uint8_t> on_ground(pieces_.size(), 0);
  double blur = 0.8;
  for (int round = 0; round < 2; ++round) {
    edge_fit_.measure(grey, pieces_, on_ground, plane.frame, {64, blur, 12}, offsets_, measured_);
    blur = std::clamp(std::sqrt(0.5 * edge_fit_.blur().trace()), 0.45, 3.0);
  }
  // Where along their edges the pieces are, by the target's plane.
  const Eigen::Matrix3d plane_from_image = plane.image_from_plane.inverse();
  std::vector<std::vector<PieceOffset>> by_edge(board_.edges.edges.size());
  for (size_t i = 0; i < offsets_.size(); ++i) {
    const EdgePiece& piece = pieces_[static_cast<size_t>(measured_[i])];
    const TargetEdge& edge = board_.edges.edges[static_cast<size_t>(piece.edge)];
    const Eigen::Vector2d q = (plane_from_image * piece.image.homogeneous()).hnormalized();
    const Eigen::Vector2d along = edge.to - edge.from;
    by_edge[static_cast<size_t>(piece.edge)].push_back({(q - edge.from).dot(along) / along.squaredNorm(),
                                                        offsets_[i].offset + plane.growth_px,
                                                        std::hypot(offsets_[i].sigma, kSystematic)});
  }
  std::vector<std::optional<EdgeCourse>> courses;
  for (const auto& pieces : by_edge) courses.push_back(fit_course(pieces));
  std::vector<BoardCorner> corners;
  for (size_t shape = 0; shape < board_.edges.shapes.size(); ++shape) {
    for (size_t k = 0; k < 4; ++k) {
      if (const auto found = corner(lens, plane, shape, k, courses)) corners.push_back(*found);
    }
  }
  std::sort(corners.begin(), corners.end(), [](const auto& a, const auto& b) {
    return std::pair(a.row, a.column) < std::pair(b.row, b.column);
  });
  return corners;
}

// Where the edge that begins there and the one that ends there cross.
std::optional<BoardCorner> SquaresFinder::corner(
    const CameraModel& lens, const PlaneMeasurement& plane, size_t shape, size_t k,
    const std::vector<std::optional<EdgeCourse>>& courses) const {
  const size_t begins = 4 * shape + k, ends = 4 * shape + (k + 3) % 4;
  if (!courses[begins] || !courses[ends]) return std::nullopt;
  const Eigen::Vector2d& q = board_.edges.edges[begins].from;
  const Eigen::Matrix3d& H = plane.image_from_plane;
  const Eigen::Vector3d p = H * q.homogeneous();
  if (!(p.z() > 0)) return std::nullopt;
  Matrix23d by_point;
  const auto pixel = lens.pixel_from_camera(p.hnormalized().homogeneous(), &by_point);
  if (!pixel) return std::nullopt;
  const Eigen::Matrix2d by_q =
      by_point.leftCols<2>() * (H.topLeftCorner<2, 2>() - p.hnormalized() * H.row(2).head<2>()) / p.z();
  // The normals of the two edges in the picture, there.
  Eigen::Matrix2d normals;
  Eigen::Vector2d offsets, variances;
  const std::array<std::pair<size_t, double>, 2> two = {{{begins, 0.0}, {ends, 1.0}}};
  for (size_t i = 0; i < 2; ++i) {
    const auto& [index, t] = two[i];
    const TargetEdge& edge = board_.edges.edges[index];
    const Eigen::Vector2d along = by_q * (edge.to - edge.from);
    Eigen::Vector2d normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
    if (normal.dot(by_q * edge.normal) < 0) normal = -normal;
    const auto row = static_cast<Eigen::Index>(i);
    normals.row(row) = normal.transpose();
    offsets[row] = courses[index]->at(t);
    variances[row] = courses[index]->variance(t);
  }
  if (std::abs(normals.determinant()) < 0.2) return std::nullopt;
  const Eigen::Matrix2d inverse = normals.inverse();
  const Eigen::Vector2d found = *pixel + inverse * offsets;
  if (found.x() < 2 || found.y() < 2 || found.x() > lens.width() - 3 || found.y() > lens.height() - 3)
    return std::nullopt;
  const double variance = 0.5 * (inverse * variances.asDiagonal() * inverse.transpose()).trace();
  const GridPlace& place = board_.places[4 * shape + k];
  return BoardCorner{place.column, place.row, found, std::sqrt(variance)};
}

}  // namespace

std::unique_ptr<BoardFinder> make_squares_finder(const TargetBoard& board,
                                                 const std::optional<CameraModel>& lens) {
  return std::make_unique<SquaresFinder>(board, lens);
}

}  // namespace perch
