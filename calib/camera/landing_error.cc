#include "calib/camera/landing_error.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// The position of the camera in the pad's frame and the rotation, (d, r) as perch/geometry/uncertainty.h has
// them, by the lens. Empty: a corner is outside of the picture.
Eigen::Matrix<double, 6, Eigen::Dynamic> pad_error_by_lens(const LensFit& fit, const CameraModel& model,
                                                           const LandingTarget& target,
                                                           const Rigid3& camera_from_target) {
  const auto rows = 2 * static_cast<Eigen::Index>(target.features.size());
  Eigen::MatrixXd J(rows, 6), B(rows, static_cast<Eigen::Index>(fit.intrinsics.size()) + 6);
  for (size_t i = 0; i < target.features.size(); ++i) {
    const Eigen::Vector2d& point = target.features[i].point;
    const Eigen::Vector3d rotated = camera_from_target.rotation * Eigen::Vector3d(point.x(), point.y(), 0);
    const Eigen::Vector3d p = rotated + camera_from_target.translation;
    Matrix23d by_point;
    const auto pixel = model.pixel_from_camera(p, &by_point);
    if (!pixel || !((pixel->array() >= 0).all() && pixel->x() < fit.width && pixel->y() < fit.height))
      return {};
    const auto row = 2 * static_cast<Eigen::Index>(i);
    J.block<2, 3>(row, 0) = by_point;
    J.block<2, 3>(row, 3) = -by_point * skew(rotated);
    B.middleRows<2>(row) = pixel_by_lens(fit, p, false);
  }
  const Eigen::MatrixXd S = (J.transpose() * J).ldlt().solve(J.transpose() * B);
  // Of target_from_camera, as of inverse(UncertainRigid3).
  const Eigen::Matrix3d Rt = camera_from_target.rotation.toRotationMatrix().transpose();
  Eigen::Matrix<double, 6, Eigen::Dynamic> pad(6, B.cols());
  pad.topRows<3>() = -Rt * (S.topRows<3>() + skew(camera_from_target.translation) * S.bottomRows<3>());
  pad.bottomRows<3>() = -Rt * S.bottomRows<3>();
  return pad;
}

double worst(const Eigen::Matrix3d& covariance) {
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues().maxCoeff());
}

}  // namespace

LandingError landing_error(const LensFit& fit, const LensCovariance& covariance, const LandingTarget& target,
                           double range) {
  constexpr int kColumns = 9, kRows = 7;
  LandingError error;
  error.range = range;
  const CameraModel model = fit.model();
  const auto n = covariance.matrix.rows();
  double position = 0, rotation = 0, alone = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const Eigen::Vector2d pixel((fit.width - 1.0) * (column + 0.5) / kColumns,
                                  (fit.height - 1.0) * (row + 0.5) / kRows);
      const auto ray = model.ray_from_pixel(pixel);
      if (!ray || !(ray->z() > 0)) continue;
      // Level above the pad: its face parallel to the picture, its x to the right and its y up in it.
      Rigid3 camera_from_target;
      camera_from_target.rotation = Eigen::Quaterniond(0, 1, 0, 0);
      camera_from_target.translation = range * *ray;
      const auto by_lens = pad_error_by_lens(fit, model, target, camera_from_target);
      if (by_lens.cols() == 0 || !by_lens.allFinite()) continue;
      ++error.directions;
      const Matrix6 all = by_lens * covariance.matrix * by_lens.transpose();
      const auto of_intrinsics = by_lens.leftCols(n - 6);
      const Matrix6 lens_alone =
          of_intrinsics * covariance.matrix.topLeftCorner(n - 6, n - 6) * of_intrinsics.transpose();
      const double sigma = worst(all.topLeftCorner<3, 3>());
      position += sigma * sigma;
      rotation += std::pow(worst(all.bottomRightCorner<3, 3>()), 2);
      alone += std::pow(worst(lens_alone.topLeftCorner<3, 3>()), 2);
      if (sigma > error.worst_m) {
        error.worst_m = sigma;
        error.worst_pixel = pixel;
      }
    }
  }
  const double count = std::max(1, error.directions);
  error.mean_m = std::sqrt(position / count);
  error.mean_rotation = std::sqrt(rotation / count);
  error.without_mount_calibration_m = std::sqrt(alone / count);
  return error;
}

}  // namespace perch
