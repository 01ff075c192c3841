#include "perch/camera/camera_model.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <span>
#include <stdexcept>

#include "perch/camera/c_numbers.h"
#include "perch/camera/opencv_lens.h"

extern "C" {  // the headers of mrcal 2.2 do not say so themselves
#include <mrcal/mrcal.h>
}

namespace perch {

struct CameraModel::Lens {
  std::string name;
  std::vector<double> intrinsics;
  Eigen::MatrixXd covariance;  // of the intrinsics; empty: unknown
  int width = 0, height = 0;
  mrcal_lensmodel_t model{};
  bool sees_behind = false;          // stereographic, lonlat, latlon, splined: z <= 0 is in view
  bool has_gradients = true;         // false: CAHVORE
  std::optional<OpencvLens> opencv;  // the models that have a closed form

  bool project(const Eigen::Vector3d& p, Eigen::Vector2d& pixel, Matrix23d* jacobian) const;
  bool project_by_mrcal(const Eigen::Vector3d& p, Eigen::Vector2d& pixel, Matrix23d* jacobian) const;
  Eigen::Vector3d first_guess(const Eigen::Vector2d& pixel) const;
};

namespace {

void check_spline(const mrcal_lensmodel_t& model, const std::string& lens) {
  if (model.type != MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC) return;
  // mrcal takes any numbers here and would read outside of the knots.
  const auto& spline = model.LENSMODEL_SPLINED_STEREOGRAPHIC__config;
  if ((spline.order != 2 && spline.order != 3) || spline.Nx <= spline.order || spline.Ny <= spline.order ||
      spline.Nx > 1000 || spline.Ny > 1000 || spline.fov_x_deg < 1 || spline.fov_x_deg >= 360) {
    throw std::invalid_argument(
        lens + ": expected order 2 or 3, 4 to 1000 knots each way and a field of view below 360");
  }
}

mrcal_lensmodel_t lens_model(const std::string& lens) {
  const CNumbers dot_is_the_decimal_point;
  mrcal_lensmodel_t model{};
  if (!mrcal_lensmodel_from_name(&model, lens.c_str())) {
    throw std::invalid_argument(lens + (model.type == MRCAL_LENSMODEL_INVALID_BADCONFIG
                                            ? ": expected the configuration of this lens in its name"
                                            : ": expected a lens model that mrcal knows"));
  }
  check_spline(model, lens);
  return model;
}

bool is_closed_form(const mrcal_lensmodel_t& model) {
  return model.type == MRCAL_LENSMODEL_PINHOLE || MRCAL_LENSMODEL_IS_OPENCV(model.type);
}

}  // namespace

CameraModel::CameraModel(const std::string& lens, std::vector<double> intrinsics, int width, int height) {
  auto made = std::make_shared<Lens>();
  made->model = lens_model(lens);
  const auto expected = static_cast<size_t>(mrcal_lensmodel_num_params(&made->model));
  if (intrinsics.size() != expected) {
    throw std::invalid_argument(lens + ": expected " + std::to_string(expected) + " intrinsics, found " +
                                std::to_string(intrinsics.size()));
  }
  for (const double value : intrinsics) {
    if (!std::isfinite(value)) throw std::invalid_argument(lens + ": expected finite intrinsics");
  }
  if (!(intrinsics[0] > 0 && intrinsics[1] > 0)) {
    throw std::invalid_argument(lens + ": expected focal lengths above 0, found " +
                                std::to_string(intrinsics[0]) + " and " + std::to_string(intrinsics[1]));
  }
  if (width <= 0 || height <= 0) {
    throw std::invalid_argument(lens + ": expected a picture size above 0, found " + std::to_string(width) +
                                " x " + std::to_string(height));
  }
  const mrcal_lensmodel_metadata_t metadata = mrcal_lensmodel_metadata(&made->model);
  made->sees_behind = metadata.can_project_behind_camera;
  made->has_gradients = metadata.has_gradients;
  if (is_closed_form(made->model)) made->opencv.emplace(intrinsics);
  made->name = lens;
  made->intrinsics = std::move(intrinsics);
  made->width = width;
  made->height = height;
  lens_ = std::move(made);
}

CameraModel CameraModel::pinhole(double fx, double fy, double cx, double cy, int width, int height) {
  return CameraModel("LENSMODEL_PINHOLE", {fx, fy, cx, cy}, width, height);
}

bool CameraModel::Lens::project(const Eigen::Vector3d& p, Eigen::Vector2d& pixel, Matrix23d* jacobian) const {
  return (opencv ? opencv->project(p, pixel, jacobian) : project_by_mrcal(p, pixel, jacobian)) &&
         pixel.allFinite();
}

bool CameraModel::Lens::project_by_mrcal(const Eigen::Vector3d& p, Eigen::Vector2d& pixel,
                                         Matrix23d* jacobian) const {
  // mrcal itself says yes to points behind the camera and returns their mirror image.
  if (!p.allFinite() || (!sees_behind && !(p.z() > 0))) return false;
  const mrcal_point3_t point{{p.x(), p.y(), p.z()}};
  mrcal_point2_t q;
  mrcal_point3_t gradients[2];
  const bool analytic = jacobian && has_gradients;
  if (!mrcal_project(&q, analytic ? gradients : nullptr, nullptr, &point, 1, &model, intrinsics.data()))
    return false;
  pixel << q.x, q.y;
  if (analytic) {
    *jacobian << gradients[0].x, gradients[0].y, gradients[0].z, gradients[1].x, gradients[1].y,
        gradients[1].z;
  } else if (jacobian) {
    // Central differences with the cube root of epsilon as their step: good to 1e-10 of the focal length.
    const double step = 6e-6 * p.norm();
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector2d before, after;
      const Eigen::Vector3d offset = step * Eigen::Vector3d::Unit(axis);
      if (!project_by_mrcal(p - offset, before, nullptr) || !project_by_mrcal(p + offset, after, nullptr))
        return false;
      jacobian->col(axis) = (after - before) / (2 * step);
    }
  }
  return !jacobian || jacobian->allFinite();
}

// The ray of the undistorted model that this lens is a deviation from.
Eigen::Vector3d CameraModel::Lens::first_guess(const Eigen::Vector2d& pixel) const {
  const mrcal_point2_t q{{pixel.x(), pixel.y()}};
  mrcal_point3_t v{{0, 0, 1}};
  switch (model.type) {
    case MRCAL_LENSMODEL_LONLAT:
      mrcal_unproject_lonlat(&v, nullptr, &q, 1, intrinsics.data());
      break;
    case MRCAL_LENSMODEL_LATLON:
      mrcal_unproject_latlon(&v, nullptr, &q, 1, intrinsics.data());
      break;
    case MRCAL_LENSMODEL_STEREOGRAPHIC:
    case MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC:
      mrcal_unproject_stereographic(&v, nullptr, &q, 1, intrinsics.data());
      break;
    default:
      mrcal_unproject_pinhole(&v, nullptr, &q, 1, intrinsics.data());
  }
  return Eigen::Vector3d(v.x, v.y, v.z).normalized();
}

std::optional<Eigen::Vector2d> CameraModel::pixel_from_camera(const Eigen::Vector3d& p_camera) const {
  return pixel_from_camera(p_camera, nullptr);
}

std::optional<Eigen::Vector2d> CameraModel::pixel_from_camera(const Eigen::Vector3d& p_camera,
                                                              Matrix23d* jacobian) const {
  Eigen::Vector2d pixel;
  if (!lens_->project(p_camera, pixel, jacobian)) return std::nullopt;
  return pixel;
}

bool CameraModel::pixels_from_camera(std::span<const Eigen::Vector3d> points_camera,
                                     std::span<Eigen::Vector2d> pixels,
                                     std::span<Matrix23d> jacobians) const {
  if (!lens_->opencv) {
    for (size_t i = 0; i < points_camera.size(); ++i) {
      if (!lens_->project(points_camera[i], pixels[i], &jacobians[i])) return false;
    }
    return true;
  }
  const OpencvLens lens = *lens_->opencv;  // a copy no write to a pixel can change: it stays in registers
  bool finite = true;
  for (size_t i = 0; i < points_camera.size(); ++i) {
    if (!lens.project(points_camera[i], pixels[i], &jacobians[i])) return false;
    finite &= pixels[i].allFinite();
  }
  return finite;
}

// Newton's method on the sphere of directions, with steps that are halved until the pixel comes nearer: it
// cannot leave the region where the lens can be inverted, since nothing projects there. mrcal_unproject does
// the same with a general solver in 1.5 us, returns true outside the valid region, and cannot do CAHVORE.
std::optional<Eigen::Vector3d> CameraModel::ray_from_pixel(const Eigen::Vector2d& pixel) const {
  constexpr int kMaxIterations = 50;      // 4 are normal; a search that creeps towards a fold takes more
  constexpr double kShortestStep = 1e-3;  // of Newton's: shorter ones do not get past an obstacle
  constexpr double kDone = 1e-9;          // rad: the step after it, its square, is below rounding
  constexpr double kMaxMiss = 1e-6;       // px
  constexpr double kNoMiss = 1e-10;  // px: rounding's own; no step comes nearer, and ten halvings are tried

  if (!pixel.allFinite()) return std::nullopt;
  Eigen::Vector3d ray = lens_->first_guess(pixel);
  Eigen::Vector2d projected;
  Matrix23d jacobian;
  // A strong pincushion's guess lies beyond its fold: towards the axis, then.
  for (int i = 0; !lens_->project(ray, projected, &jacobian); ++i) {
    if (i == 10 || !ray.allFinite()) return std::nullopt;
    ray = (ray + Eigen::Vector3d::UnitZ()).normalized();
  }
  double miss = (pixel - projected).norm();
  for (int i = 0; i < kMaxIterations && miss > kNoMiss; ++i) {
    Eigen::Matrix<double, 3, 2> tangent;
    tangent.col(0) = ray.unitOrthogonal();
    tangent.col(1) = ray.cross(tangent.col(0));
    const Eigen::Vector3d step = tangent * (jacobian * tangent).inverse() * (pixel - projected);
    double scale = 1;
    for (; scale > kShortestStep; scale /= 2) {
      const Eigen::Vector3d next = (ray + scale * step).normalized();
      Eigen::Vector2d next_projected;
      Matrix23d next_jacobian;
      if (!lens_->project(next, next_projected, &next_jacobian)) continue;
      const double next_miss = (pixel - next_projected).norm();
      if (!(next_miss < miss)) continue;
      ray = next, projected = next_projected, jacobian = next_jacobian, miss = next_miss;
      break;
    }
    if (scale <= kShortestStep || !(scale * step.norm() > kDone)) break;
  }
  if (!(miss <= kMaxMiss)) return std::nullopt;
  return ray;
}

bool CameraModel::pixel_by_intrinsics(const Eigen::Vector3d& p, ByIntrinsics* jacobian) const {
  const auto count = static_cast<Eigen::Index>(lens_->intrinsics.size());
  Eigen::Vector2d pixel;
  if (count > kMostKnownIntrinsics || !lens_->has_gradients || !lens_->project(p, pixel, nullptr))
    return false;
  jacobian->resize(2, count);
  const mrcal_point3_t point{{p.x(), p.y(), p.z()}};
  mrcal_point2_t q;
  return mrcal_project(&q, nullptr, jacobian->data(), &point, 1, &lens_->model, lens_->intrinsics.data()) &&
         jacobian->allFinite();
}

const Eigen::MatrixXd& CameraModel::intrinsics_covariance() const { return lens_->covariance; }

CameraModel CameraModel::with_intrinsics_covariance(const Eigen::MatrixXd& covariance) const {
  const auto count = static_cast<Eigen::Index>(lens_->intrinsics.size());
  if (covariance.rows() != count || covariance.cols() != count || count > kMostKnownIntrinsics) {
    throw std::invalid_argument(lens_->name + ": expected a covariance of " + std::to_string(count) +
                                " intrinsics, 16 at most");
  }
  if (!covariance.allFinite() || !covariance.isApprox(covariance.transpose(), 1e-9))
    throw std::invalid_argument(lens_->name + ": expected a covariance that is finite and symmetric");
  // By correlations: the intrinsics' own sizes lie decades apart. A singular one may be below 0 by rounding.
  const Eigen::VectorXd sigmas = covariance.diagonal().cwiseMax(1e-300).cwiseSqrt();
  const Eigen::MatrixXd correlation =
      sigmas.cwiseInverse().asDiagonal() * covariance * sigmas.cwiseInverse().asDiagonal();
  const bool negative =
      covariance.diagonal().minCoeff() < 0 ||
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(correlation).eigenvalues().minCoeff() < -1e-6;
  if (negative)
    throw std::invalid_argument(lens_->name + ": expected a covariance without negative variances");
  CameraModel known = *this;
  auto lens = std::make_shared<Lens>(*lens_);
  lens->covariance = covariance;
  known.lens_ = std::move(lens);
  return known;
}

int CameraModel::width() const { return lens_->width; }
int CameraModel::height() const { return lens_->height; }
const std::string& CameraModel::lens() const { return lens_->name; }
const std::vector<double>& CameraModel::intrinsics() const { return lens_->intrinsics; }

}  // namespace perch
