#include "perch/camera/camera_model.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <thread>

#include "camera/lenses.h"
#include "support/near_pose.h"
#include "support/rng.h"

extern "C" {
#include <mrcal/mrcal.h>
}

namespace perch {
namespace {

struct ByMrcal {
  Eigen::Vector2d pixel;
  Matrix23d jacobian;
};

ByMrcal project_by_mrcal(const CameraModel& camera, const Eigen::Vector3d& p) {
  mrcal_lensmodel_t model;
  EXPECT_TRUE(mrcal_lensmodel_from_name(&model, camera.lens().c_str()));
  const mrcal_point3_t point{{p.x(), p.y(), p.z()}};
  mrcal_point2_t q;
  mrcal_point3_t j[2];
  EXPECT_TRUE(mrcal_project(&q, j, nullptr, &point, 1, &model, camera.intrinsics().data()));
  ByMrcal result{{q.x, q.y}, {}};
  result.jacobian << j[0].x, j[0].y, j[0].z, j[1].x, j[1].y, j[1].z;
  return result;
}

std::vector<std::string> all_lenses() {
  auto names = closed_form_lenses();
  names.insert(names.end(), other_lenses().begin(), other_lenses().end());
  return names;
}

TEST(CameraModel, ClosedFormEqualsMrcalsWithItsJacobian) {
  TestRng rng;
  for (const auto& lens : closed_form_lenses()) {
    int seen = 0;
    for (int i = 0; i < 3000; ++i) {
      const CameraModel camera = random_camera(rng, lens);
      const Eigen::Vector3d p = random_point(rng, camera);
      Matrix23d jacobian;
      const auto pixel = camera.pixel_from_camera(p, &jacobian);
      if (!pixel) continue;
      ++seen;
      const ByMrcal expected = project_by_mrcal(camera, p);
      // Rounding: some 50 operations on numbers as large as the terms of the polynomials; near a pole of the
      // denominator these cancel, which the size of the result tells.
      const double size = std::max(5000.0, expected.pixel.norm());
      EXPECT_THAT(*pixel, IsNearMatrix(expected.pixel, 100 * kEpsilon * size * size / 5000)) << lens;
      const double slope = std::max(5000 / p.z(), expected.jacobian.norm());
      EXPECT_THAT(jacobian, IsNearMatrix(expected.jacobian, 1000 * kEpsilon * slope * slope * p.z() / 5000))
          << lens;
    }
    EXPECT_GT(seen, 2000) << lens;
  }
}

TEST(CameraModel, JacobianIsTheSlopeOfTheProjection) {
  TestRng rng;
  for (const auto& lens : all_lenses()) {
    int seen = 0;
    for (int i = 0; i < 200; ++i) {
      const CameraModel camera = random_camera(rng, lens);
      const Eigen::Vector3d p = random_point(rng, camera);
      Matrix23d jacobian;
      if (!camera.pixel_from_camera(p, &jacobian)) continue;
      Matrix23d numeric;
      const double step = 1e-5 * p.norm();
      bool inside = true;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d offset = step * Eigen::Vector3d::Unit(axis);
        const auto after = camera.pixel_from_camera(p + offset),
                   before = camera.pixel_from_camera(p - offset);
        inside = inside && after && before;
        if (inside) numeric.col(axis) = (*after - *before) / (2 * step);
      }
      if (!inside) continue;
      ++seen;
      // Central differences: step^2 times the third derivative, which grows towards a fold, plus
      // rounding/step.
      EXPECT_THAT(jacobian, IsNearMatrix(numeric, 1e-5 * (jacobian.norm() + 1000 / p.norm()))) << lens;
    }
    EXPECT_GT(seen, 100) << lens;
  }
}

TEST(CameraModel, JacobianOverloadGivesTheSamePixel) {
  TestRng rng;
  for (const auto& lens : all_lenses()) {
    const CameraModel camera = random_camera(rng, lens);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p = random_point(rng, camera);
      Matrix23d jacobian;
      const auto with = camera.pixel_from_camera(p, &jacobian), without = camera.pixel_from_camera(p);
      ASSERT_EQ(with.has_value(), without.has_value()) << lens;
      // mrcal takes other paths with and without gradients; ours is one.
      if (with) {
        EXPECT_LE((*with - *without).norm(), 1e-9) << lens;
      }
    }
  }
}

TEST(CameraModel, RayOfAPixelIsWhereThePointLies) {
  TestRng rng;
  for (const auto& lens : all_lenses()) {
    int seen = 0;
    for (int i = 0; i < 3000; ++i) {
      const CameraModel camera = random_camera(rng, lens);
      const Eigen::Vector3d p = random_point(rng, camera);
      Matrix23d jacobian;
      const auto pixel = camera.pixel_from_camera(p, &jacobian);
      if (!pixel || pixel->norm() > 10000) continue;
      // Close to a fold a pixel says little about its direction: rad per px, there, times the rounding of
      // pixels.
      const double px_per_rad = Eigen::JacobiSVD<Matrix23d>(jacobian).singularValues()[1] * p.norm();
      if (px_per_rad < 0.05 * camera.intrinsics()[0]) continue;
      ++seen;
      const auto ray = camera.ray_from_pixel(*pixel);
      ASSERT_TRUE(ray) << lens << " " << pixel->transpose() << " of " << p.transpose();
      EXPECT_NEAR(ray->norm(), 1, 4 * kEpsilon);
      EXPECT_LE(ray->cross(p.normalized()).norm(), 1e-9) << lens << " " << pixel->transpose();
      EXPECT_GT(ray->dot(p), 0);
    }
    EXPECT_GT(seen, 1000) << lens;
  }
}

TEST(CameraModel, RaysProjectToTheirPixelOrThereAreNone) {
  TestRng rng;
  for (const auto& lens : all_lenses()) {
    for (int i = 0; i < 500; ++i) {
      const CameraModel camera = random_camera(rng, lens);
      const Eigen::Vector2d pixel(rng.uniform(-2000, 4000), rng.uniform(-2000, 4000));
      const auto ray = camera.ray_from_pixel(pixel);
      if (!ray) continue;
      const auto again = camera.pixel_from_camera(*ray);
      ASSERT_TRUE(again) << lens;
      EXPECT_LE((*again - pixel).norm(), 1e-6) << lens;
    }
  }
}

// r - 0.3 r^3 turns at r = sqrt(1 / 0.9) = 1.054, where it reaches 0.703.
TEST(CameraModel, PointsBeyondTheFoldAreNotSeen) {
  const CameraModel camera("LENSMODEL_OPENCV4", {500, 500, 320, 240, -0.3, 0, 0, 0}, 640, 480);
  EXPECT_TRUE(camera.pixel_from_camera({1.05, 0, 1}));
  EXPECT_FALSE(camera.pixel_from_camera({1.06, 0, 1}));
  // At 1.6 the polynomial gives 0.37: mrcal puts that point into the picture.
  EXPECT_LT(project_by_mrcal(camera, {1.6, 0, 1}).pixel.x(), 520);
  EXPECT_FALSE(camera.pixel_from_camera({1.6, 0, 1}));

  EXPECT_TRUE(camera.ray_from_pixel({320 + 500 * 0.70, 240}));
  EXPECT_FALSE(camera.ray_from_pixel({320 + 500 * 0.71, 240}));
  EXPECT_FALSE(camera.ray_from_pixel({320, -5000}));
}

// 1 / (1 - s) has its pole at 45 degrees; r / (1 - s) grows without bound before it and comes back from the
// other side after it.
TEST(CameraModel, PointsBeyondAPoleAreNotSeen) {
  const CameraModel camera("LENSMODEL_OPENCV8", {500, 500, 320, 240, 0, 0, 0, 0, 0, -1, 0, 0}, 640, 480);
  EXPECT_TRUE(camera.pixel_from_camera({0.99, 0, 1}));
  EXPECT_FALSE(camera.pixel_from_camera({1.01, 0, 1}));
  // r / (1 - r^2) = 2 at r = (sqrt(17) - 1) / 4.
  const auto ray = camera.ray_from_pixel({1320, 240});
  ASSERT_TRUE(ray);
  EXPECT_NEAR(ray->x() / ray->z(), (std::sqrt(17.0) - 1) / 4, 1e-12);
}

TEST(CameraModel, OnlyStereographicAndPanoramicLensesSeeBehind) {
  TestRng rng;
  for (const auto& lens : all_lenses()) {
    const CameraModel camera = random_camera(rng, lens);
    const bool sees_behind =
        lens.find("STEREO") != std::string::npos || lens.find("LAT") != std::string::npos;
    Matrix23d jacobian;
    EXPECT_EQ(camera.pixel_from_camera({1, 0.3, -0.1}).has_value(), sees_behind) << lens;
    EXPECT_EQ(camera.pixel_from_camera({1, 0.3, -0.1}, &jacobian).has_value(), sees_behind) << lens;
    EXPECT_EQ(camera.pixel_from_camera({1, 0.3, 0}).has_value(), sees_behind) << lens;
  }
}

TEST(CameraModel, WhatIsNotFiniteIsNotSeen) {
  TestRng rng;
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  for (const auto& lens : all_lenses()) {
    const CameraModel camera = random_camera(rng, lens);
    EXPECT_FALSE(camera.pixel_from_camera({nan, 0, 1})) << lens;
    EXPECT_FALSE(camera.pixel_from_camera({0, nan, 1})) << lens;
    EXPECT_FALSE(camera.pixel_from_camera({0, 0, nan})) << lens;
    EXPECT_FALSE(camera.pixel_from_camera({infinity, 0, 1})) << lens;
    EXPECT_FALSE(camera.pixel_from_camera({0, 0, 0})) << lens;
    EXPECT_FALSE(camera.ray_from_pixel({nan, 0})) << lens;
    EXPECT_FALSE(camera.ray_from_pixel({0, infinity})) << lens;
  }
}

TEST(CameraModel, PinholeIsThePinhole) {
  const CameraModel camera = CameraModel::pinhole(500, 510, 320, 240, 640, 480);
  EXPECT_THAT(*camera.pixel_from_camera({0.2, -0.4, 2}), IsNearMatrix(Eigen::Vector2d(370, 138), 1e-12));
  EXPECT_THAT(*camera.ray_from_pixel({820, 240}), IsNearMatrix(Eigen::Vector3d(1, 0, 1).normalized(), 1e-15));
  EXPECT_EQ(camera.width(), 640);
  EXPECT_EQ(camera.height(), 480);
  EXPECT_EQ(camera.lens(), "LENSMODEL_PINHOLE");
}

std::string why_not(const std::string& lens, std::vector<double> intrinsics, int width = 640,
                    int height = 480) {
  try {
    CameraModel(lens, std::move(intrinsics), width, height);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "accepted";
}

TEST(CameraModel, RefusesWhatCannotBeACamera) {
  EXPECT_EQ(why_not("LENSMODEL_FISHEYE", {1, 1, 0, 0}),
            "LENSMODEL_FISHEYE: expected a lens model that mrcal knows");
  EXPECT_EQ(why_not("LENSMODEL_CAHVORE", {1, 1, 0, 0}),
            "LENSMODEL_CAHVORE: expected the configuration of this lens in its name");
  EXPECT_EQ(why_not("LENSMODEL_OPENCV4", {1, 1, 0, 0}), "LENSMODEL_OPENCV4: expected 8 intrinsics, found 4");
  EXPECT_EQ(why_not("LENSMODEL_PINHOLE", {500, std::nan(""), 320, 240}),
            "LENSMODEL_PINHOLE: expected finite intrinsics");
  EXPECT_EQ(why_not("LENSMODEL_PINHOLE", {500, 0, 320, 240}),
            "LENSMODEL_PINHOLE: expected focal lengths above 0, found 500.000000 and 0.000000");
  EXPECT_EQ(why_not("LENSMODEL_PINHOLE", {500, 500, 320, 240}, 0),
            "LENSMODEL_PINHOLE: expected a picture size above 0, found 0 x 480");
  // mrcal takes both; the second one's number of parameters overflows an int.
  for (const char* spline : {"order=9_Nx=0_Ny=15_fov_x_deg=90", "order=3_Nx=65000_Ny=65000_fov_x_deg=90"}) {
    EXPECT_NE(why_not(std::string("LENSMODEL_SPLINED_STEREOGRAPHIC_") + spline, {1, 1, 0, 0})
                  .find("expected order"),
              std::string::npos);
  }
}

TEST(CameraModel, ThreadsGetTheSameNumbers) {
  TestRng rng;
  const CameraModel camera = random_camera(rng, other_lenses().back());
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 500; ++i) points.push_back(random_point(rng, camera));
  std::array<std::vector<double>, 4> results;
  std::vector<std::thread> threads;
  for (auto& result : results) {
    threads.emplace_back([&] {
      for (const auto& p : points) {
        const auto pixel = camera.pixel_from_camera(p);
        const auto ray = camera.ray_from_pixel(*pixel);
        result.push_back(pixel->x());
        result.push_back(ray ? ray->x() : -2);
      }
    });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& result : results) EXPECT_EQ(result, results[0]);
}

}  // namespace
}  // namespace perch
