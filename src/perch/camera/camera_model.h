#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace perch {

using Matrix23d = Eigen::Matrix<double, 2, 3>;

// How a camera projects: any lens model that libmrcal knows. Camera frame: x right, y down, z forward, m.
// Pixels: integer coordinates are pixel centres, (0, 0) the centre of the top-left pixel.
// Cheap to copy; all calls are const and may run in several threads.
class CameraModel {
 public:
  // `lens` is mrcal's name with its configuration ("LENSMODEL_OPENCV4",
  // "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_..."), `intrinsics` fx fy cx cy and its distortions. Throws
  // std::invalid_argument for a lens mrcal does not know, a wrong number of intrinsics, NaN, or a size or
  // focal length that is not positive.
  CameraModel(const std::string& lens, std::vector<double> intrinsics, int width, int height);

  // fx, fy, cx, cy without distortion.
  static CameraModel pinhole(double fx, double fy, double cx, double cy, int width, int height);

  // The pixel of a point; empty when the lens cannot see it or the result is not finite. The models that grow
  // out of the pinhole (PINHOLE, OPENCV*, CAHVOR, CAHVORE) see nothing at z <= 0; STEREOGRAPHIC, LONLAT,
  // LATLON and SPLINED_STEREOGRAPHIC do. PINHOLE and OPENCV* see nothing beyond the radius where their
  // polynomial folds and would put a point far outside of the picture into it.
  std::optional<Eigen::Vector2d> pixel_from_camera(const Eigen::Vector3d& p_camera) const;
  // The same with d pixel / d p_camera, unless `jacobian` is null. 25 ns for PINHOLE and OPENCV*, 200 to 400
  // ns for the others; CAHVORE's is numeric, good to 1e-9 of the focal length.
  std::optional<Eigen::Vector2d> pixel_from_camera(const Eigen::Vector3d& p_camera,
                                                   Matrix23d* jacobian) const;

  // The same for many points at once, in half the time; false, with nothing promised about the rest, as soon
  // as one is not seen. All three are as long as `points_camera`.
  bool pixels_from_camera(std::span<const Eigen::Vector3d> points_camera, std::span<Eigen::Vector2d> pixels,
                          std::span<Matrix23d> jacobians) const;

  // The direction in which a pixel looks, of unit length. Empty when the inversion does not converge, that is
  // when its projection is not the pixel again to 1e-6 px: outside the part of the picture the lens model is
  // valid in.
  std::optional<Eigen::Vector3d> ray_from_pixel(const Eigen::Vector2d& pixel) const;

  // d pixel / d intrinsics of a point, whatever the lens; false where it is not seen. Without an allocation
  // for up to kMostKnownIntrinsics of them.
  using ByIntrinsics = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, 16>;
  bool pixel_by_intrinsics(const Eigen::Vector3d& p_camera, ByIntrinsics* jacobian) const;

  // How well the intrinsics are known: their covariance, or an empty matrix when nobody has said, as
  // for lenses of more than kMostKnownIntrinsics.
  static constexpr int kMostKnownIntrinsics = 16;  // LENSMODEL_OPENCV12; a spline has hundreds
  const Eigen::MatrixXd& intrinsics_covariance() const;
  // The same camera with it. Throws std::invalid_argument unless it is square, of a row an intrinsic, finite,
  // symmetric and nowhere negative.
  CameraModel with_intrinsics_covariance(const Eigen::MatrixXd& covariance) const;

  int width() const;
  int height() const;
  const std::string& lens() const;
  const std::vector<double>& intrinsics() const;

 private:
  struct Lens;
  std::shared_ptr<const Lens> lens_;
};

// Reads *.cameramodel (mrcal), a ROS camera_info YAML, an OpenCV FileStorage YAML or an ASL sensor.yaml, told
// apart by what is in the file. Throws ConfigError naming the file, the line where there is one, and the
// cause.
CameraModel read_camera_model(const std::filesystem::path& file);

}  // namespace perch
