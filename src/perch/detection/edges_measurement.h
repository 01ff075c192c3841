#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perch/detection/detector.h"
#include "perch/detection/edge_fit.h"
#include "perch/detection/edge_piece.h"
#include "perch/detection/edges_options.h"

namespace perch {

// Blurs that differ by no more than this part of one are the same.
inline constexpr double kSameBlur = 0.15;

// Measures a target by the places of its edges, to a few hundredths of a pixel each. Holds its working
// memory.
class EdgesMeasurement {
 public:
  // `size`: of the target, m.
  EdgesMeasurement(const TargetEdges& edges, double size, const CameraModel& camera,
                   const EdgesOptions& options)
      : edges_(edges), size_(size), camera_(camera), options_(options) {}

  // From a homography that is right to about a pixel, and the blur as far as it is known. With `must_confirm`
  // empty, too, where the target is not in view as a whole or is not there, edge for edge: that says more
  // than any search. Adds what is left of each edge to `residuals`.
  std::optional<PlaneMeasurement> measure(const cv::Mat& grey, const Eigen::Matrix3d& image_from_plane,
                                          double blur_px, bool must_confirm,
                                          std::vector<EdgeResidual>& residuals);

 private:
  const TargetShape& shape_of(const EdgePiece& piece) const;
  bool is_all_in_view() const;
  bool drop_narrow_pieces(double blur_px);
  void share_growth();
  bool is_most_measured() const;

  TargetEdges edges_;
  double size_;
  CameraModel camera_;
  EdgesOptions options_;
  EdgeFit edge_fit_;
  std::vector<EdgePiece> pieces_;
  std::vector<uint8_t> on_ground_;  // of each piece, whether it is of the outline
  std::vector<EdgeOffset> offsets_;
  std::vector<int> measured_;  // the piece of each offset
};

}  // namespace perch
