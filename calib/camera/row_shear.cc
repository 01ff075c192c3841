#include "calib/camera/row_shear.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

// A pose and a shift are 8 unknowns of 2 numbers a corner.
constexpr int kFewestCorners = 10;
// Of a shift that is smaller the landing has nothing to fear.
constexpr double kShiftPx = 0.1;
constexpr double kMedianOfNoise = 1.386;  // of chi squared with two degrees of freedom: 2 ln 2

struct ViewShear {
  double gain = 0, shift_px = 0;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::optional<ViewShear> shear_of(const BoardViews& views, const LensFit& fit, const CameraModel& model,
                                  size_t view) {
  const auto& corners = views.views[view].corners;
  const Eigen::Quaterniond rotation = so3_exp(fit.camera_from_board[view].head<3>());
  const Eigen::Vector3d translation = fit.camera_from_board[view].tail<3>();
  const auto most = 2 * static_cast<Eigen::Index>(corners.size());
  Eigen::MatrixXd J(most, 6), S(most, 2);
  Eigen::VectorXd e(most);
  Eigen::Index rows = 0;
  for (size_t k = 0; k < corners.size(); ++k) {
    const BoardCorner& corner = corners[k];
    if (fit.corners[view][k].outlier) continue;
    // The bend is no matter to how a pixel moves with the pose.
    const Eigen::Vector3d rotated =
        rotation * (views.grid.spacing * Eigen::Vector3d(corner.column, corner.row, 0));
    Matrix23d by_point;
    if (!model.pixel_from_camera(rotated + translation, &by_point)) continue;
    J.block<2, 3>(rows, 0) = -by_point * skew(rotated);
    J.block<2, 3>(rows, 3) = by_point;
    S.block<2, 2>(rows, 0) = (corner.pixel.y() / views.height - 0.5) * Eigen::Matrix2d::Identity();
    e.segment<2>(rows) = fit.corners[view][k].error_px;
    // Both sides of the equation by the corner's own sigma.
    for (Eigen::Index r = rows; r < rows + 2; ++r) {
      J.row(r) /= corner.sigma;
      S.row(r) /= corner.sigma;
      e[r] /= corner.sigma;
    }
    rows += 2;
  }
  if (rows < 2 * kFewestCorners) return std::nullopt;
  J.conservativeResize(rows, 6), S.conservativeResize(rows, 2), e.conservativeResize(rows);
  // What of the shift no pose takes up.
  const Eigen::MatrixXd beside = S - J * (J.transpose() * J).ldlt().solve(J.transpose() * S);
  const Eigen::Vector2d v = (beside.transpose() * beside).ldlt().solve(beside.transpose() * e);
  const ViewShear found{(beside * v).squaredNorm() / (fit.sigma_px * fit.sigma_px), v.norm()};
  if (!std::isfinite(found.gain) || !std::isfinite(found.shift_px)) return std::nullopt;
  return found;
}

}  // namespace

bool RowShear::shows() const {
  return views >= 5 && shift_px > kShiftPx && median_gain > kMedianOfNoise + 5 * 2 / std::sqrt(views);
}

RowShear row_shear(const BoardViews& views, const LensFit& fit) {
  const CameraModel model = fit.model();
  std::vector<double> gains, shifts;
  for (size_t i = 0; i < views.views.size(); ++i) {
    const auto found = shear_of(views, fit, model, i);
    if (!found) continue;
    gains.push_back(found->gain);
    shifts.push_back(found->shift_px);
  }
  if (gains.empty()) return {};
  return {static_cast<int>(gains.size()), median(shifts), median(gains)};
}

}  // namespace perch
