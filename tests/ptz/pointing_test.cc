#include "perch/ptz/pointing.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "perch/ptz/search_pattern.h"
#include "perch/ptz/zoom_to_fill.h"
#include "support/rng.h"

namespace perch {
namespace {

constexpr double kDeg = 0.017453292519943295;

// Eq. 3.1: theta = atan2(p - d/2, d/2 cot(f/2)).
double h(double p, double d, double f) { return std::atan2(p - d / 2, d / 2 / std::tan(f / 2)); }

CameraModel wide_camera() {
  const double f = 320 / std::tan(24.4 * kDeg);
  return CameraModel::pinhole(f, f, 320, 240, 640, 480);
}

TEST(Pointing, IsThePapersOnTheAxesOfThePicture) {
  const CameraModel camera = wide_camera();
  const double fx = 48.8 * kDeg, fy = 2 * std::atan(0.75 * std::tan(24.4 * kDeg));
  for (const double x : {20.0, 300.0, 500.0}) {
    const auto by = angles_between(camera, {}, {x, 240}, {320, 240});
    ASSERT_TRUE(by);
    EXPECT_NEAR(by->pan, h(x, 640, fx) - h(320, 640, fx), 1e-9);  // eq. 3.2
    EXPECT_NEAR(by->tilt, 0, 1e-9);
  }
  for (const double y : {20.0, 300.0, 470.0}) {
    const auto by = angles_between(camera, {}, {320, y}, {320, 240});
    ASSERT_TRUE(by);
    // Eq. 3.3 with the paper's sign of the tilt: positive moves the target down in the picture, so up is
    // positive.
    EXPECT_NEAR(by->tilt, -(h(y, 480, fy) - h(240, 480, fy)), 1e-9);
    EXPECT_NEAR(by->pan, 0, 1e-9);
  }
}

TEST(Pointing, BringsAnyPixelToAnyOtherExactly) {
  TestRng rng;
  const CameraModel camera("LENSMODEL_OPENCV4", {453, 453.5, 316.2, 242.8, -0.13, 0.019, -0.0005, 0.0003},
                           640, 480);
  for (int i = 0; i < 200; ++i) {
    const HeadAngles now{rng.uniform(-1.5, 1.5), rng.uniform(-0.4, 0.4)};
    const Eigen::Vector2d from(rng.uniform(0, 639), rng.uniform(0, 479)),
        to(rng.uniform(0, 639), rng.uniform(0, 479));
    const auto by = angles_between(camera, now, from, to);
    ASSERT_TRUE(by);
    const Eigen::Vector3d seen = zero_from_camera(now, *camera.ray_from_pixel(from));
    const HeadAngles then{now.pan + by->pan, now.tilt + by->tilt};
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(then.pan, Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(then.tilt, Eigen::Vector3d::UnitX()));
    const auto pixel = camera.pixel_from_camera(turn.conjugate() * seen);
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - to).norm(), 1e-4);  // ray_from_pixel is good to 1e-6 px, twice
  }
}

TEST(Pointing, SaysWhenNoAnglesDo) {
  EXPECT_FALSE(angles_to_see_at(Eigen::Vector3d::UnitY(), {0.3, 0.1, 1}));
  EXPECT_FALSE(angles_to_see_at({0, NAN, 1}, {0, 0, 1}));
}

TEST(SearchPattern, CoversEverythingTheHeadReaches) {
  const HeadModel model = evi_d30();
  const double view = 37 * kDeg;
  const SearchPattern search(model, view);
  EXPECT_NEAR(search.at(0, {0.3, 0.1}).pan, 0.3, 1e-9);
  EXPECT_NEAR(search.at(0, {0.3, 0.1}).tilt, 0.1, 1e-9);
  std::vector<HeadAngles> way;
  HeadAngles before = search.at(0, {});
  for (double t = 0; t < 60; t += 0.02) {
    way.push_back(search.at(t, {}));
    ASSERT_GE(way.back().pan, model.pan.min);
    ASSERT_LE(way.back().tilt, model.tilt.max);
    if (t > search.spiral_duration() + 0.1) {
      EXPECT_LE(std::abs(way.back().pan - before.pan), model.pan.max_speed * 0.02 + 1e-9) << t;
      EXPECT_LE(std::abs(way.back().tilt - before.tilt), model.tilt.max_speed * 0.02 + 1e-9) << t;
    }
    before = way.back();
  }
  for (double pan = model.pan.min; pan <= model.pan.max; pan += 0.1) {
    for (double tilt = model.tilt.min; tilt <= model.tilt.max; tilt += 0.1) {
      double nearest = 10;
      for (const HeadAngles& at : way) nearest = std::min(nearest, std::hypot(at.pan - pan, at.tilt - tilt));
      EXPECT_LT(nearest, view / 2) << pan << ' ' << tilt;
    }
  }
}

TEST(ZoomToFill, FillsAndKeepsTheTargetInThePicture) {
  const ZoomLens lens = [](double zoom) {
    const double f = 320 / std::tan(24.4 * kDeg) * std::pow(12, zoom);
    return CameraModel::pinhole(f, f, 319.5, 239.5, 640, 480);
  };
  const auto part = [&](double zoom, double angle) {
    return lens(zoom).intrinsics()[0] * std::tan(angle) / 240;
  };
  const double still = zoom_to_fill(lens, 2 * kDeg, 0, 0.5);
  EXPECT_NEAR(part(still, 2 * kDeg), 0.5, 0.5 * std::log(12) / 1024 * 1.01);
  EXPECT_LE(part(still, 2 * kDeg), 0.5);
  // What moves needs room.
  const double quick = zoom_to_fill(lens, 2 * kDeg, 6 * kDeg, 0.5);
  EXPECT_LT(quick, still);
  EXPECT_LE(part(quick, 8 * kDeg), 1);
  EXPECT_EQ(zoom_to_fill(lens, 20 * kDeg, 0, 0.5), 0);    // too large at the widest
  EXPECT_EQ(zoom_to_fill(lens, 0.01 * kDeg, 0, 0.5), 1);  // too small at the narrowest
}

}  // namespace
}  // namespace perch
