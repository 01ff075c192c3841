#pragma once

#include <ceres/ceres.h>

#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <vector>

#include "perch/geometry/rigid3.h"
#include "perch/pose/reprojection.h"

namespace perch {

// The same least squares by other means: ceres::Problem with automatic derivatives over a quaternion and its
// manifold, through a lens written down from OpenCV's documentation. Shares nothing with the product but the
// numbers.

// A pose as Ceres takes it: q x y z w, then the translation.
using CeresPose = Eigen::Matrix<double, 7, 1>;

inline CeresPose ceres_pose(const Rigid3& pose) {
  CeresPose x;
  x << pose.rotation.coeffs(), pose.translation;
  return x;
}
inline Rigid3 pose_of(const CeresPose& x) {
  return {Eigen::Quaterniond(x.head<4>()).normalized(), x.tail<3>()};
}

template <typename T>
Eigen::Matrix<T, 3, 1> transformed(const T* pose, const Eigen::Vector3d& p_target) {
  const Eigen::Map<const Eigen::Quaternion<T>> rotation(pose);
  const Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation(pose + 4);
  return rotation * p_target.cast<T>() + translation;
}

// k: fx fy cx cy k1 k2 p1 p2 k3.
template <typename T>
Eigen::Matrix<T, 2, 1> opencv5_pixel(std::span<const double> k, const Eigen::Matrix<T, 3, 1>& p) {
  const T x = p.x() / p.z(), y = p.y() / p.z();
  const T r2 = x * x + y * y;
  const T radial = 1.0 + k[4] * r2 + k[5] * r2 * r2 + k[8] * r2 * r2 * r2;
  const T u = x * radial + 2.0 * k[6] * x * y + k[7] * (r2 + 2.0 * x * x);
  const T v = y * radial + k[6] * (r2 + 2.0 * y * y) + 2.0 * k[7] * x * y;
  return {k[0] * u + k[2], k[1] * v + k[3]};
}

// The whitened pixel errors of all observations over a CeresPose.
struct PixelErrors {
  std::vector<double> intrinsics;
  std::span<const Observation> observations;

  template <typename T>
  bool operator()(const T* const pose, T* residuals) const {
    for (size_t i = 0; i < observations.size(); ++i) {
      const auto& o = observations[i];
      const auto pixel = opencv5_pixel<T>(intrinsics, transformed(pose, o.p_target));
      residuals[2 * i] = (pixel.x() - o.pixel.x()) / o.sigma_px;
      residuals[2 * i + 1] = (pixel.y() - o.pixel.y()) / o.sigma_px;
    }
    return true;
  }
};

// G of the paper's equation 2.7 over a CeresPose.
struct PaperErrors {
  std::span<const Eigen::Vector2d> plane, image;

  template <typename T>
  bool operator()(const T* const pose, T* residuals) const {
    for (size_t i = 0; i < plane.size(); ++i) {
      const auto c = transformed(pose, Eigen::Vector3d(plane[i].x(), plane[i].y(), 0));
      residuals[2 * i] = image[i].x() * c.z() - c.x();
      residuals[2 * i + 1] = image[i].y() * c.z() - c.y();
    }
    return true;
  }
};

// A problem that stands: the observations behind its cost functions may change between solves.
class CeresReference {
 public:
  CeresReference() {
    problem_.AddParameterBlock(
        x_.data(), 7,
        new ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>());
    options_.linear_solver_type = ceres::DENSE_QR;
    options_.logging_type = ceres::SILENT;
    options_.max_num_iterations = 100;
    // To the last digit: it ends where no step lowers the cost.
    options_.function_tolerance = 0;
    options_.gradient_tolerance = 0;
    options_.parameter_tolerance = 1e-14;
  }

  // One block of all errors; `loss` is Ceres', on the sum of its squares, so only for blocks of one point.
  template <typename Errors>
  void add(Errors errors, size_t points, ceres::LossFunction* loss = nullptr) {
    problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<Errors, ceres::DYNAMIC, 7>(
                                  new Errors(std::move(errors)), static_cast<int>(2 * points)),
                              loss, x_.data());
  }

  Rigid3 solve(const Rigid3& start) {
    x_ = ceres_pose(start);
    ceres::Solve(options_, &problem_, &summary_);
    return pose_of(x_);
  }
  double cost() const { return 2 * summary_.final_cost; }  // without Ceres' one half
  ceres::Solver::Options& options() { return options_; }

 private:
  CeresPose x_ = CeresPose::Zero();
  ceres::Problem problem_;
  ceres::Solver::Options options_;
  ceres::Solver::Summary summary_;
};

}  // namespace perch
